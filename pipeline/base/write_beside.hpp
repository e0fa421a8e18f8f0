#pragma once
#include <filesystem>
#include <functional>

namespace emmetrope {

/// For libraries that write files themselves, as write_file() does it: `write` makes a file beside the target, of the same
/// extension, which takes the target's place when it is whole and on the disk.
/// \param write  \return whether it could
/// \throw Error (not_writable), or what `write` throws; the target is as it was then
void write_beside(const std::filesystem::path& file,
                  const std::function<bool(const std::filesystem::path& part)>& write);

}  // namespace emmetrope
