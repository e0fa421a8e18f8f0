#include "pipeline/report/living/view_command.hpp"

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>
#include <memory>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/living/case_eyes.hpp"
#include "pipeline/report/living/living_panel.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

/// As it is typed.
struct Flags {
  fs::path case_folder, output;
  std::string eye;
};

Answer view_named(const Flags& flags, const CommonOptions& common) {
  raytrace::EyeMapSettings settings;
  settings.seed = common.seed;
  settings.threads = common.thread_count();
  const EyeModel eye = make_eye(flags.eye);
  const std::string name = fs::path(flags.eye).stem().string();
  const LivingSubject subject{"eye",
                              name,
                              eye,
                              raytrace::living_schematic_eye(flags.eye, settings),
                              {},
                              "",
                              true,
                              0,
                              eye.stop()->stop_diameter_mm};
  const fs::path output = flags.output.empty() ? fs::path(name + ".html") : flags.output;
  write_file(output,
             render_living_page("What the eye " + name + " sees",
                                make_living_panel({living_json(subject, settings.threads)},
                                                  {"The eye's map: " + subject.living.map.note() + "."})));
  return {ExitStatus::done,
          {{"html", output.string()}, {"map", subject.living.map.note()}},
          output.string() + "\n"};
}

Answer view_case(const Flags& flags, const CommonOptions& common) {
  const CaseData data = read_case(flags.case_folder, common.laterality);
  const CaseEyes eyes = living_eyes_of(data, common.thread_count(), common.seed);
  if (eyes.eyes.empty()) {
    std::string why;
    for (const auto& note : eyes.notes) why += (why.empty() ? "" : " ") + note;  // sentences
    throw no_result_error("no eye of the case can be shown: " + why,
                          "run the stages before: emmetrope trace CASE");
  }
  const fs::path output = flags.output.empty() ? flags.case_folder / "view.html" : flags.output;
  write_file(output, render_living_page("What the eyes of " + data.subject() + " see",
                                        make_living_panel(eyes.eyes, eyes.notes)));
  for (const std::string& why : eyes.not_traced) spdlog::warn("{}", why);
  return {eyes.eyes.size() == data.eyes.size() ? ExitStatus::done : ExitStatus::partial,
          {{"html", output.string()}, {"notes", eyes.notes}},
          output.string() + "\n"};
}

}  // namespace

Command view_command() {
  const auto flags = std::make_shared<Flags>();
  Command command;
  command.name = "view";
  command.summary = "A page in which an eye looks at charts and scenes, through lenses that are dragged.";
  command.example = "emmetrope view --eye navarro -o eye.html";
  command.declare = [flags](CLI::App& app) {
    auto* folder = app.add_option("CASE|EYE", flags->case_folder,
                                  "Case folder, traced; or what --eye takes, where there is no such folder");
    app.add_option("--eye", flags->eye, "Schematic eye by name, or an eye.json")
        ->type_name("NAME|FILE")
        ->excludes(folder);
    app.add_option("-o,--output", flags->output, "The page (CASE/view.html, NAME.html)")
        ->type_name("FILE.html");
  };
  command.run = [flags](const CommonOptions& common) {
    if (const std::string ending = flags->output.extension();
        !flags->output.empty() && ending != ".html" && ending != ".htm")
      throw usage_error("--output: " + flags->output.string() + " is to be a page, whose name ends in .html");
    if (flags->eye.empty() && !flags->case_folder.empty() && !fs::is_directory(flags->case_folder))
      flags->eye = flags->case_folder.string();
    if (!flags->eye.empty()) return view_named(*flags, common);
    if (flags->case_folder.empty())
      throw usage_error("neither a case nor an eye is named",
                        "emmetrope view CASE, or emmetrope view --eye navarro");
    return view_case(*flags, common);
  };
  return command;
}

}  // namespace emmetrope::report
