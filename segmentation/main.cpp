#include "segmentation/command.hpp"

int main(int argc, char** argv) {
  return emmetrope::run_command(argc, argv, emmetrope::segmentation::command());
}
