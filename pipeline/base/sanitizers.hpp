#pragma once

/// Of a build under a sanitizer of addresses or threads, by GCC or clang: it needs terabytes of address space for its
/// shadow memory, and system calls of its own, so that nothing is limited or confined there.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EMMETROPE_UNDER_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define EMMETROPE_UNDER_SANITIZER
#endif
#endif
