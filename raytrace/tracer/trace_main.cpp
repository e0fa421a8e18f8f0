#include "raytrace/tracer/trace_command.hpp"

int main(int argc, char** argv) {
  return emmetrope::run_command(argc, argv, emmetrope::raytrace::trace_command());
}
