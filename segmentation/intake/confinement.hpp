#pragma once
#include <string>

namespace emmetrope::segmentation {

/// What of the confinement the kernel grants.
struct Confinement {
  bool system_calls = false;  ///< seccomp: only those of reading files, computing and answering
  bool files = false;         ///< Landlock: no file is changed or executed

  /// "seccomp and Landlock", "seccomp", "Landlock", "nothing"
  std::string in_words() const;
};

/// From here on this process can read files, compute, and answer over what it has open: no new privileges, no network, no
/// other process started, signalled or looked into, nothing written to disk, no memory both written and executed. It can
/// still read what its user can. Under a sanitizer, which needs more, nothing is confined.
Confinement confine_process();

// Its parts, each without new privileges; \return whether the kernel grants it.
/// Landlock (Linux 5.13): no file is written, made, removed, renamed or executed.
bool forbid_changes_of_files();
/// seccomp: all of the above, but for writing through what is open already.
bool forbid_system_calls();

}  // namespace emmetrope::segmentation
