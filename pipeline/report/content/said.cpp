#include "pipeline/report/content/said.hpp"

#include "pipeline/base/eye_stage.hpp"

namespace emmetrope::report {
namespace {

struct Sentence {
  std::string eye, words;  ///< "OD (right): ", or empty
};

Sentence parts_of(const std::string& text) {
  Sentence sentence{"", text};
  for (const Laterality eye : both_eyes)
    if (const std::string name = std::string(clinical_name(eye)) + ": "; text.rfind(name, 0) == 0)
      sentence = {name, text.substr(name.size())};
  if (sentence.words.rfind(refused_by_segmentation, 0) == 0)
    sentence.words.erase(0, std::string(refused_by_segmentation).size());
  return sentence;
}

}  // namespace

bool is_said(const std::string& reason, const std::vector<std::string>& sentences) {
  auto [eye, left] = parts_of(reason);
  for (const std::string& text : sentences) {
    const Sentence said = parts_of(text);
    if (said.eye != eye) continue;
    if (said.words.find(left) != std::string::npos) return true;
    if (const auto at = left.find(said.words); at != std::string::npos) left.erase(at, said.words.size());
  }
  return left.find_first_not_of("; ") == std::string::npos;
}

}  // namespace emmetrope::report
