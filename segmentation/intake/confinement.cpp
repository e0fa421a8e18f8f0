#include "segmentation/intake/confinement.hpp"

#include <fcntl.h>
#include <linux/landlock.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <sstream>

#include "pipeline/base/sanitizers.hpp"

namespace emmetrope::segmentation {
namespace {

/// Rights over files but those to read them, as far as the kernel's version of Landlock knows them (landlock(7)).
__u64 rights_to_change(long version) {
  __u64 rights = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                 LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_DIR |
                 LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
                 LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SYM;
  constexpr __u64 refer = 1ULL << 13, truncate = 1ULL << 14;  // of versions 2 and 3
  if (version >= 2) rights |= refer;
  if (version >= 3) rights |= truncate;
  return rights;
}

}  // namespace

bool forbid_changes_of_files() {
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  const long version = ::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 1) return false;
  landlock_ruleset_attr attributes{};
  attributes.handled_access_fs = rights_to_change(version);
  const auto rules =
      static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes, 0));
  if (rules < 0) return false;
  const bool holds = ::syscall(SYS_landlock_restrict_self, rules, 0) == 0;
  ::close(rules);
  return holds;
}

namespace {

/// What decoding takes, by name: of another architecture or C library some are missing, which is as well.
constexpr const char* harmless_calls =
    "access arch_prctl brk clock_getres clock_gettime clock_nanosleep close dup exit exit_group faccessat "
    "faccessat2 fadvise64 fstat fstatfs futex getcwd getdents64 getegid geteuid getgid getpid getrandom "
    "getrlimit getrusage gettid gettimeofday getuid lseek lstat madvise mremap munmap nanosleep newfstatat "
    "poll ppoll pread64 read readlink readlinkat readv restart_syscall rseq rt_sigaction rt_sigprocmask "
    "rt_sigreturn sched_getaffinity sched_yield set_robust_list setrlimit sigaltstack stat statfs statx "
    "sysinfo time uname write writev";

struct Release {
  void operator()(void* filter) const { seccomp_release(filter); }
};

}  // namespace

bool forbid_system_calls() {
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  const std::unique_ptr<void, Release> filter(seccomp_init(SCMP_ACT_ERRNO(EPERM)));
  if (!filter) return false;
  // One that is not allowed after all fails where it is needed, which the parent tells.
  const auto allow = [&](const char* name, unsigned conditions, const scmp_arg_cmp* condition) {
    const int number = seccomp_syscall_resolve_name(name);
    if (number != __NR_SCMP_ERROR)
      seccomp_rule_add_array(filter.get(), SCMP_ACT_ALLOW, number, conditions, condition);
  };
  std::istringstream names(harmless_calls);
  for (std::string name; names >> name;) allow(name.c_str(), 0, nullptr);
  const auto allow_if = [&](const char* name, const scmp_arg_cmp& condition) { allow(name, 1, &condition); };
  constexpr scmp_datum_t to_change = O_ACCMODE | O_CREAT | O_TRUNC | O_APPEND;
  allow_if("open", SCMP_A1(SCMP_CMP_MASKED_EQ, to_change, O_RDONLY));
  allow_if("openat", SCMP_A2(SCMP_CMP_MASKED_EQ, to_change, O_RDONLY));
  // Not F_SETOWN and F_SETSIG, which send signals.
  for (const int command : {F_GETFD, F_SETFD, F_GETFL, F_DUPFD, F_DUPFD_CLOEXEC})
    allow_if("fcntl", SCMP_A1(SCMP_CMP_EQ, static_cast<scmp_datum_t>(command)));
  // Memory that is written is not executed: a library is mapped to be executed as it lies on the disk.
  allow_if("mmap", SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  allow_if("mmap", SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_WRITE, 0));
  allow_if("mprotect", SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  allow_if("prlimit64", SCMP_A0(SCMP_CMP_EQ, 0));                                   // limit_processor_time
  allow_if("tgkill", SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(::getpid())));  // abort()
  return seccomp_load(filter.get()) == 0;
}

std::string Confinement::in_words() const {
  if (system_calls && files) return "seccomp and Landlock";
  if (system_calls) return "seccomp";
  return files ? "Landlock" : "nothing";
}

Confinement confine_process() {
#ifdef EMMETROPE_UNDER_SANITIZER
  return {};
#else
  Confinement confinement;
  confinement.files = forbid_changes_of_files();
  confinement.system_calls = forbid_system_calls();
  return confinement;
#endif
}

}  // namespace emmetrope::segmentation
