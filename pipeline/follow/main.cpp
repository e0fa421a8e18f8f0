#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/follow/follow.hpp"

int main(int argc, char** argv) {
  emmetrope::follow::FollowOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"follow",
       "How the eyes of one person grow, from the finished cases of two or more visits fitted together.",
       "emmetrope follow case-2024 case-2025 -o growth",
       [&](CLI::App& app) {
         app.add_option("visits", options.visits, "Cases, the first visit first")
             ->required()
             ->type_name("VISIT ...");
         app.add_option("-o,--output", options.output, "Folder for growth.json, growth.html and growth.pdf")
             ->required()
             ->type_name("OUT");
         app.add_option("--years", options.years,
                        "When the visits were, where their studies do not tell: 0,1.1")
             ->delimiter(',')
             ->type_name("Y,Y,...");
         app.add_option(
                "--scale-sd", options.scale_sigma,
                "Relative standard deviation of the scanner's scale between visits (0.001; two scanners 0.004)")
             ->check(CLI::Range(0.0, 0.1))
             ->type_name("SD");
       },
       [&](const emmetrope::CommonOptions& common) {
         return emmetrope::follow::run_follow(options, common);
       }});
}
