#include "pipeline/cohort/sweep/sweep_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// The eye of `emmetrope eye` has no option; what looks like one is a file's name.
std::vector<std::string> words_of(const std::string& command, const Setting& setting) {
  if (command == "eye" && setting.option == "eye")
    return {setting.text.rfind('-', 0) == 0 ? "./" + setting.text : setting.text};
  return setting.words;
}

/// The command's result as JSON: a file that it wrote, or its answer.
/// \throw Error (input_invalid) where it is none
Json result_of(const std::string& command, const fs::path& folder, const std::string& answer) {
  if (command == "eye") return parse_json(answer, "the answer");
  return read_json(folder / (command == "trace" ? "wavefront.json" : "prescription.json"));
}

/// Of an answer, in one line.
std::string warnings_in(const std::string& answer) {
  const Json json = Json::parse(answer, nullptr, false);
  std::string all;
  if (json.is_object())
    for (const Json& warning : json.value("warnings", Json::array()))
      all += (all.empty() ? "warning: " : "; ") + warning.get<std::string>();
  return all;
}

void add_file(const fs::path& file, Json& files);

/// Every text in it that names a file beside it: pictures and models of a scene, meshes of an eye.
void add_named_files(const Json& json, const fs::path& folder, Json& files) {
  if (json.is_structured()) {
    for (const Json& part : json) add_named_files(part, folder, files);
  } else if (json.is_string()) {
    const fs::path named = folder / json.get<std::string>();
    std::error_code unreadable;
    if (!json.get<std::string>().empty() && fs::is_regular_file(named, unreadable)) add_file(named, files);
  }
}

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

/// Kinds of files in the same folder that a file of this kind may be read with: glasses, materials, pictures.
std::set<std::string> companions_of(const fs::path& file) {
  const std::string kind = lower_case(file.extension());
  if (kind == ".zmx") return {".agf"};
  if (kind == ".obj") return {".mtl", ".png", ".jpg", ".jpeg"};
  if (kind == ".gltf") return {".bin", ".png", ".jpg", ".jpeg"};
  return {};
}

/// The file, and what it names where it is JSON, each with its hash.
void add_file(const fs::path& file, Json& files) {
  const std::string path = file.lexically_normal().string();
  if (files.contains(path)) return;
  files[path] = sha256_of_file(file);
  if (const std::set<std::string> companions = companions_of(file); !companions.empty())
    for (const auto& entry : fs::directory_iterator(fs::absolute(file).parent_path()))
      if (entry.is_regular_file() && companions.count(lower_case(entry.path().extension())) > 0)
        add_file(entry.path(), files);
  if (file.extension() != ".json") return;
  const Json json = Json::parse(read_file(file), nullptr, false);
  if (!json.is_discarded()) add_named_files(json, file.parent_path(), files);
}

/// "/a/b.json" of "--eye=/a/b.json".
fs::path path_in(const std::string& word) {
  const std::size_t equals = word.rfind("--", 0) == 0 ? word.find('=') : std::string::npos;
  return equals == std::string::npos ? word : word.substr(equals + 1);
}

/// What all runs are asked for, but for what the sweep sets itself.
void add_shared(const Sweep& sweep, const std::vector<Setting>& settings,
                const std::vector<std::string>& shared, std::vector<std::string>& words) {
  for (std::size_t i = 0; i + 1 < shared.size(); i += 2) {
    const auto is_set = [&](const Setting& setting) { return "--" + setting.option == shared[i]; };
    if (std::none_of(sweep.fixed.begin(), sweep.fixed.end(), is_set) &&
        std::none_of(settings.begin(), settings.end(), is_set))
      words.insert(words.end(), {shared[i], shared[i + 1]});
  }
}

}  // namespace

Json sweep_plan(const Sweep& sweep, const std::vector<Setting>& settings,
                const std::vector<std::string>& shared) {
  std::vector<std::string> words;
  Json files = Json::object();
  const auto add = [&](const Setting& setting) {
    for (const std::string& word : words_of(sweep.command, setting)) {
      words.push_back(word);
      const fs::path file = path_in(word);
      std::error_code unreadable;
      if (file.is_absolute() && fs::is_regular_file(file, unreadable)) add_file(file, files);
    }
  };
  std::for_each(sweep.fixed.begin(), sweep.fixed.end(), add);
  std::for_each(settings.begin(), settings.end(), add);
  add_shared(sweep, settings, shared, words);
  return {{"command", sweep.command}, {"words", words}, {"files", files}, {"version", version()}};
}

std::string run_name(const Json& plan) {
  constexpr std::size_t digits = 12;
  return sha256_of(plan.dump()).substr(0, digits);
}

int run_of_sweep(const SweepFolder& folder, const std::string& run, const Attempt& attempt) {
  const Json plan = read_json(folder.plan(run));
  const std::string command = plan.at("command");
  std::vector<std::string> words = plan.at("words");
  fs::remove_all(folder.results(run));
  if (command != "eye") {
    fs::create_directories(folder.results(run));
    words.insert(words.end(), {"-o", folder.results(run).string(), "--force"});
  }
  words.insert(words.end(), {"--json", "--quiet", "--threads", std::to_string(attempt.threads)});
  const ProcessResult ended =
      run_process(executable_folder() / ("emmetrope-" + command), words, ChildOutput::capture);
  if (was_interrupted(ended.status)) return ended.status;
  if (is_of_the_machine(ended.status) && attempt.number < attempt.of) return ended.status;
  Json end{{"status", ended.status}, {"message", ""}, {"result", nullptr}};
  if (gave_result(ended.status)) {
    try {
      end["result"] = result_of(command, folder.results(run), ended.output);
      end["message"] = warnings_in(ended.output);
    } catch (const Error& unreadable) {
      end["message"] = unreadable.what();
    }
  } else {
    end["message"] = message_of_failure(ended);
  }
  fs::create_directories(folder.end(run).parent_path());
  write_json(folder.end(run), end);
  return 0;
}

}  // namespace emmetrope::cohort
