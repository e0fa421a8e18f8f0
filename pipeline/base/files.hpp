#pragma once
#include <filesystem>
#include <string>
#include <string_view>

namespace emmetrope {

/// The whole file.
/// \throw Error (input_invalid) when it cannot be read
std::string read_file(const std::filesystem::path& file);

/// Whether a regular file is there; not where no file can have that name, as it is too long, say.
bool is_file(const std::filesystem::path& path);

/// That a file may be put there: a device, a pipe or a folder would be lost to what reads or writes it.
/// \throw Error (not_writable) naming it
void require_replaceable(const std::filesystem::path& file);

/// Writes beside the target, checks every step, syncs, renames: the file holds all of `bytes` or is as it
/// was.
/// \throw Error (not_writable) naming the file and the system's reason
void write_file(const std::filesystem::path& file, std::string_view bytes);

/// SHA-256 as 64 hexadecimal digits.
std::string sha256_of(std::string_view bytes);
/// \throw Error (input_invalid) when the file cannot be read
std::string sha256_of_file(const std::filesystem::path& file);

/// Folder of data that is installed with the program (share/emmetrope) or, in a build tree, its source
/// folder: found from the place of the running executable, so that an installed tree can be moved.
/// \throw Error (fault) when it does not exist
std::filesystem::path data_folder();

/// The folder of the running executable, where its sibling commands are.
std::filesystem::path executable_folder();

}  // namespace emmetrope
