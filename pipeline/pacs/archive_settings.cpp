#include "pipeline/pacs/archive_settings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope::pacs {
namespace {

namespace fs = std::filesystem;

/// \param of  before the key in messages: "tls."
/// \param otherwise  where the key is not there; nothing: it has to be
template <class T>
T setting(const fs::path& file, const Json& json, const std::string& of, const char* key,
          const std::optional<T>& otherwise = {}) {
  if (otherwise && !json.contains(key)) return *otherwise;
  constexpr bool is_text = std::is_same_v<T, std::string>;
  const Json value = json.value(key, Json());
  if (!(is_text ? value.is_string() : value.is_number()))
    throw input_error(
        fmt::format("{}: {}{} is {}", file.string(), of, key, value.is_null() ? "missing" : value.dump()),
        is_text ? "a text in quotes" : "a number without quotes");
  return value.get<T>();
}

/// An application entity's name has 1 to 16 characters (PS3.5, VR AE).
std::string ae_title(const fs::path& file, const Json& json, const char* key, const char* otherwise) {
  std::string title = setting<std::string>(file, json, "", key, otherwise);
  const bool is_valid =
      !title.empty() && title.size() <= 16 &&
      std::all_of(title.begin(), title.end(), [](char c) { return c >= ' ' && c <= '~' && c != '\\'; });
  if (!is_valid)
    throw input_error(fmt::format("{}: {} is \"{}\"", file.string(), key, title), "1 to 16 ASCII characters");
  return title;
}

fs::path named_file(const fs::path& file, const Json& json, const char* key) {
  const std::string name = setting<std::string>(file, json, "tls.", key, "");
  if (name.empty()) return {};
  fs::path named = file.parent_path() / name;
  if (!is_file(named))
    throw input_error(fmt::format("{}: tls.{}: there is no file {}", file.string(), key, named.string()));
  return named;
}

/// A misspelt "tls" would send everything in the clear.
void require_known(const fs::path& file, const Json& json, const std::string& of,
                   const std::vector<std::string>& known) {
  if (!json.is_object()) throw input_error(fmt::format("{}: {}expected an object", file.string(), of));
  for (const auto& [key, value] : json.items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw input_error(fmt::format("{}: {}\"{}\" is unknown", file.string(), of, key),
                        fmt::format("expected {}", fmt::join(known, ", ")));
}

TlsFiles tls_files(const fs::path& file, const Json& json) {
  require_known(file, json, "tls: ", {"authority", "certificate", "key"});
  TlsFiles tls{named_file(file, json, "authority"), named_file(file, json, "certificate"),
               named_file(file, json, "key")};
  if (tls.authority.empty())
    throw input_error(file.string() + ": tls.authority is missing",
                      "name the PEM file of the certificates that vouch for the archive");
  if (tls.certificate.empty() != tls.key.empty())
    throw input_error(file.string() + ": tls.certificate and tls.key belong together");
  return tls;
}

}  // namespace

ArchiveSettings read_settings(const fs::path& file) {
  const Json json = read_json(file);
  require_known(file, json, "", {"host", "port", "called_ae_title", "calling_ae_title", "timeout_s", "tls"});
  ArchiveSettings settings;
  settings.host = setting<std::string>(file, json, "", "host");
  const auto port = setting<double>(file, json, "", "port");
  if (settings.host.empty() || !(port >= 1 && port <= 65535 && port == std::floor(port)))
    throw input_error(fmt::format("{}: host is \"{}\", port {}", file.string(), settings.host, port),
                      "a name and a number from 1 to 65535");
  settings.port = static_cast<std::uint16_t>(port);
  settings.called_ae_title = ae_title(file, json, "called_ae_title", "");
  settings.calling_ae_title = ae_title(file, json, "calling_ae_title", "EMMETROPE");
  const auto timeout_s = setting<double>(file, json, "", "timeout_s", settings.timeout_s);
  if (!(timeout_s >= 1 && timeout_s <= 3600 && timeout_s == std::floor(timeout_s)))
    throw input_error(fmt::format("{}: timeout_s is {}", file.string(), timeout_s),
                      "a whole number from 1 to 3600");
  settings.timeout_s = static_cast<int>(timeout_s);
  if (json.contains("tls")) settings.tls = tls_files(file, json.at("tls"));
  return settings;
}

}  // namespace emmetrope::pacs
