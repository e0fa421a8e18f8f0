#include "pipeline/report/living/view_command.hpp"

int main(int argc, char** argv) {
  return emmetrope::run_command(argc, argv, emmetrope::report::view_command());
}
