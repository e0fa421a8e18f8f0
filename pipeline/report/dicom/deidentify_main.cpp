#include "pipeline/report/dicom/deidentify_command.hpp"

int main(int argc, char** argv) {
  return emmetrope::run_command(argc, argv, emmetrope::report::deidentify_command());
}
