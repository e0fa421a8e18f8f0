#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace emmetrope::pacs {

/// What a TLS connection needs, as PEM files.
struct TlsFiles {
  std::filesystem::path authority;         ///< certificates that vouch for the archive
  std::filesystem::path certificate, key;  ///< this program's own, where the archive asks for one; else empty
};

/// Where an archive is and what it is told.
struct ArchiveSettings {
  std::string host;
  std::uint16_t port = 0;
  std::string called_ae_title, calling_ae_title;
  int timeout_s = 60;
  std::optional<TlsFiles> tls;
};

/// Reads {"host", "port", "called_ae_title", "calling_ae_title" ("EMMETROPE"), "timeout_s" (60), "tls": {"authority",
/// "certificate", "key"}}; files are found from the folder of the settings.
/// \throw Error (input_invalid) naming file and key
ArchiveSettings read_settings(const std::filesystem::path& file);

}  // namespace emmetrope::pacs
