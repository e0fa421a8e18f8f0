#include "raytrace/command.hpp"

int main(int argc, char** argv) { return emmetrope::run_command(argc, argv, emmetrope::raytrace::command()); }
