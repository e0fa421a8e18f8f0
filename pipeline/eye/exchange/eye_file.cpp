#include "pipeline/eye/exchange/eye_file.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/exchange/optiland.hpp"
#include "pipeline/eye/exchange/words.hpp"
#include "pipeline/eye/exchange/zmx.hpp"

namespace emmetrope {
namespace {

bool is_zmx(const std::filesystem::path& file) { return capitals(file.extension().string()) == ".ZMX"; }

}  // namespace

EyeModel read_eye_file(const std::filesystem::path& file) {
  if (is_zmx(file)) return read_zmx(file);
  const std::string text = read_file(file);
  const bool of_optiland = is_optiland(text);
  const Json json = parse_json(of_optiland ? without_infinities(text) : text, file.string());
  try {
    return of_optiland ? eye_from_optiland(json) : eye_from_json(json, file.parent_path());
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

WrittenEye write_eye_file(const std::filesystem::path& file, const EyeModel& eye) {
  if (is_zmx(file)) return {{file, glass_catalogue_beside(file)}, write_zmx(file, eye)};
  write_eye(file, eye);
  return {{file}, {}};
}

}  // namespace emmetrope
