#ifndef COMMRAM_REGISTERS_H
#define COMMRAM_REGISTERS_H

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the registers are little endian; this header does not swap bytes"
#endif

/*
 * A register. From C11 on its plain use (x = y, y = x) is one sequentially consistent access of the register's own
 * width. In C++ and in C99 a register is only volatile, so use the macros where the order of accesses matters. The
 * macros have the same effect in all these languages.
 */
#if defined(__cplusplus) || __STDC_VERSION__ < 201112L
#define COMMRAM_CELL(type) volatile type
#define COMMRAM_LOAD(cell) __atomic_load_n(&(cell), __ATOMIC_SEQ_CST)
#define COMMRAM_STORE(cell, value) __atomic_store_n(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_ADD(cell, value) __atomic_fetch_add(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_SUB(cell, value) __atomic_fetch_sub(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_SWAP_IF(cell, expected, value)                                                                   \
    __atomic_compare_exchange_n(&(cell), (expected), (value), 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST)
#else
#include <stdatomic.h>
#define COMMRAM_CELL(type) volatile _Atomic(type)
#define COMMRAM_LOAD(cell) atomic_load(&(cell))
#define COMMRAM_STORE(cell, value) atomic_store(&(cell), (value))
#define COMMRAM_ADD(cell, value) atomic_fetch_add(&(cell), (value))
#define COMMRAM_SUB(cell, value) atomic_fetch_sub(&(cell), (value))
#define COMMRAM_SWAP_IF(cell, expected, value) atomic_compare_exchange_strong(&(cell), (expected), (value))
#endif

#if defined(__cplusplus)
#define COMMRAM_ASSERT(condition, text) static_assert(condition, text)
#elif __STDC_VERSION__ >= 201112L
#define COMMRAM_ASSERT(condition, text) _Static_assert(condition, text)
#else
#define COMMRAM_ASSERT(condition, text) extern char commram_asserted[(condition) ? 1 : -1]
#endif

#ifdef __cplusplus
extern "C" {
#endif

/*
 * The headers of the system declare these names only if certain macros were defined before the first of these headers.
 * This header may be included after any other header and in any mode of the language, so it has its own names.
 */
#ifdef O_CLOEXEC
#define COMMRAM_O_CLOEXEC O_CLOEXEC
#else
#define COMMRAM_O_CLOEXEC __O_CLOEXEC
#endif
#ifdef O_NOFOLLOW
#define COMMRAM_O_NOFOLLOW O_NOFOLLOW
#else
#define COMMRAM_O_NOFOLLOW __O_NOFOLLOW
#endif
long commram_system(long number, ...) __asm__("syscall");

/* A `struct timespec` of the kernel. */
typedef struct commram_timespec {
    long seconds, nanoseconds;
} commram_timespec;

