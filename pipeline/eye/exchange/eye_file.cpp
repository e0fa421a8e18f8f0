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
  if (!is_optiland(text)) return read_eye(file);
  try {
    return eye_from_optiland(text, file.string());
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

std::vector<std::string> write_eye_file(const std::filesystem::path& file, const EyeModel& eye) {
  if (is_zmx(file)) return write_zmx(file, eye);
  write_eye(file, eye);
  return {};
}

}  // namespace emmetrope
