#include "pipeline/driver/doctor.hpp"

#include <CLI/CLI.hpp>
int main(int argc, char** argv) {
  return emmetrope::run_command(argc, argv,
                                {"doctor", "What this machine lacks for Emmetrope, and the remedy.",
                                 "emmetrope doctor", [](CLI::App&) {}, emmetrope::driver::examine_machine});
}
