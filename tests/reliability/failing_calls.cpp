// A library to preload: of one kind of call the Nth since main fails, once, as a system does that has run out.
// Then the file that EMMETROPE_FAILED names is made. EMMETROPE_FAILS=KIND:N, KIND one of open, read, write, fsync, rename, mmap, clone, malloc. GNU C library.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <spawn.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>

extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
}

namespace {

enum Kind {
  none,
  open_call,
  read_call,
  write_call,
  fsync_call,
  rename_call,
  mmap_call,
  clone_call,
  malloc_call
};
constexpr const char* names[] = {"", "open", "read", "write", "fsync", "rename", "mmap", "clone", "malloc"};

std::atomic<long> left{0};
Kind failing = none;

void plan() {
  const char* text = std::getenv("EMMETROPE_FAILS");
  const char* colon = text == nullptr ? nullptr : std::strchr(text, ':');
  if (colon == nullptr) return;
  left = std::atol(colon + 1);
  for (int kind = open_call; kind <= malloc_call; ++kind)
    if (std::strncmp(text, names[kind], static_cast<size_t>(colon - text)) == 0)
      failing = static_cast<Kind>(kind);
}

using Main = int (*)(int, char**, char**);
Main own_main = nullptr;

/// What the loader and the libraries' own beginnings do before is not the program's to handle.
int planned_main(int count, char** words, char** environment) {
  plan();
  return own_main(count, words, environment);
}

/// A program of others writes into its pipe as if that could not fail, and it cannot while this project reads there.
bool is_pipe_of_others(int descriptor) {
  struct stat what {};
  return std::strncmp(program_invocation_short_name, "emmetrope", 9) != 0 &&
         ::fstat(descriptor, &what) == 0 && S_ISFIFO(what.st_mode);
}

/// Whether this call is the one; the errno that it leaves.
bool fails(Kind kind, int reason) {
  if (kind != failing || --left != 0) return false;
  if (const char* marker = std::getenv("EMMETROPE_FAILED"))
    ::close(static_cast<int>(::syscall(SYS_openat, AT_FDCWD, marker, O_WRONLY | O_CREAT, 0600)));
  errno = reason;
  return true;
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

#define NEXT(name) static const auto real = next<decltype(&name)>(#name)

extern "C" {

int __libc_start_main(Main main, int count, char** words, void (*begin)(), void (*end)(), void (*leave)(),
                      void* stack) {
  NEXT(__libc_start_main);
  own_main = main;
  return real(planned_main, count, words, begin, end, leave, stack);
}

int open(const char* file, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  NEXT(open);
  return fails(open_call, EMFILE) ? -1 : real(file, flags, mode);
}
int open64(const char* file, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  NEXT(open64);
  return fails(open_call, EMFILE) ? -1 : real(file, flags, mode);
}
FILE* fopen(const char* file, const char* mode) {
  NEXT(fopen);
  return fails(open_call, EMFILE) ? nullptr : real(file, mode);
}
FILE* fopen64(const char* file, const char* mode) {
  NEXT(fopen64);
  return fails(open_call, EMFILE) ? nullptr : real(file, mode);
}
ssize_t read(int descriptor, void* bytes, size_t size) {
  NEXT(read);
  return fails(read_call, EIO) ? -1 : real(descriptor, bytes, size);
}
size_t fread(void* bytes, size_t size, size_t count, FILE* file) {
  NEXT(fread);
  return fails(read_call, EIO) ? 0 : real(bytes, size, count, file);
}
ssize_t write(int descriptor, const void* bytes, size_t size) {
  NEXT(write);
  return !is_pipe_of_others(descriptor) && fails(write_call, ENOSPC) ? -1 : real(descriptor, bytes, size);
}
size_t fwrite(const void* bytes, size_t size, size_t count, FILE* file) {
  NEXT(fwrite);
  return !is_pipe_of_others(::fileno(file)) && fails(write_call, ENOSPC) ? 0 : real(bytes, size, count, file);
}
int fsync(int descriptor) {
  NEXT(fsync);
  return fails(fsync_call, EIO) ? -1 : real(descriptor);
}
int rename(const char* from, const char* to) {
  NEXT(rename);
  return fails(rename_call, ENOSPC) ? -1 : real(from, to);
}
void* mmap(void* at, size_t size, int protection, int flags, int descriptor, off_t offset) {
  NEXT(mmap);
  return fails(mmap_call, ENOMEM) ? MAP_FAILED : real(at, size, protection, flags, descriptor, offset);
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*), void* argument) {
  NEXT(pthread_create);
  return fails(clone_call, EAGAIN) ? EAGAIN : real(thread, attributes, run, argument);
}
int posix_spawn(pid_t* child, const char* program, const posix_spawn_file_actions_t* actions,
                const posix_spawnattr_t* attributes, char* const* arguments, char* const* environment) {
  NEXT(posix_spawn);
  return fails(clone_call, EAGAIN) ? EAGAIN
                                   : real(child, program, actions, attributes, arguments, environment);
}
pid_t fork() {
  NEXT(fork);
  return fails(clone_call, EAGAIN) ? -1 : real();
}
void* malloc(size_t size) { return fails(malloc_call, ENOMEM) ? nullptr : __libc_malloc(size); }
void* calloc(size_t count, size_t size) {
  return fails(malloc_call, ENOMEM) ? nullptr : __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
  return fails(malloc_call, ENOMEM) ? nullptr : __libc_realloc(block, size);
}

}  // extern "C"
