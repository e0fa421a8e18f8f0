// The doors under libFuzzer, which looks for inputs that reach new code: EMMETROPE_FUZZ_DOOR=vtp emmetrope-libfuzzer CORPUS
// with libFuzzer's own options (-max_total_time=60, -merge=1).
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "pipeline/base/error.hpp"
#include "tests/fuzz/doors.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace emmetrope::fuzz {
namespace {

namespace fs = std::filesystem;

/// The door that the environment names; a fault without one.
const Door& chosen_door() {
  const char* name = std::getenv("EMMETROPE_FUZZ_DOOR");
  for (const Door& door : doors())
    if (name != nullptr && door.name == name) return door;
  std::cerr << "EMMETROPE_FUZZ_DOOR names none of:";
  for (const Door& door : doors()) std::cerr << " " << door.name;
  std::cerr << "\n";
  std::exit(2);
}

const Door& door() {
  static const Door& chosen = chosen_door();
  return chosen;
}

fs::path input_file() {
  static const fs::path folder = [] {
    fs::path made = fs::temp_directory_path() / ("libfuzzer-" + std::to_string(::getpid()));
    fs::remove_all(made);  // of an earlier process of this number
    fs::create_directories(made);
    return made;
  }();
  return folder / door().file;
}

}  // namespace
}  // namespace emmetrope::fuzz

/// Writes the door's whole inputs into the corpus, the first argument that is a folder.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  namespace fs = std::filesystem;
  spdlog::set_level(spdlog::level::off);
  emmetrope::fuzz::door();  // ends here where none is named, before an input could be blamed
  for (int k = 1; k < *argc; ++k) {
    if (!fs::is_directory((*argv)[k])) continue;
    const fs::path seeds = emmetrope::fuzz::input_file().parent_path() / "seeds";
    fs::create_directories(seeds);
    std::size_t number = 0;
    for (const std::string& seed : emmetrope::fuzz::door().seeds(seeds))
      std::ofstream(fs::path((*argv)[k]) / ("whole-" + std::to_string(++number)), std::ios::binary) << seed;
    fs::remove_all(seeds);
    break;
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using emmetrope::fuzz::input_file;
  std::filesystem::remove(input_file());
  std::ofstream(input_file(), std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  try {
    emmetrope::fuzz::door().open(input_file());
  } catch (const emmetrope::Error& refusal) {
    if (refusal.status() == emmetrope::ExitStatus::fault) throw;
  }
  return 0;
}

/// Half of the changes know the format.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (seed % 2 == 0) return LLVMFuzzerMutate(data, size, max_size);
  emmetrope::fuzz::Random random(seed);
  const std::string changed =
      emmetrope::fuzz::door().mutate(std::string(reinterpret_cast<const char*>(data), size), random);
  const std::size_t length = std::min(changed.size(), max_size);
  std::copy_n(changed.data(), length, data);
  return length;
}
