#ifndef COMMRAM_REGISTERS_H
#define COMMRAM_REGISTERS_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
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
#include <time.h>
#include <unistd.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the registers are little endian; this header does not swap bytes"
#endif

/*
 * A register. In C its plain use (x = y, y = x) is one sequentially consistent access of the register's own
 * width. In C++ it is volatile only: use the macros where order matters. They are the same in both languages.
 */
#ifdef __cplusplus
#define _Static_assert static_assert
#define COMMRAM_CELL(type) volatile type
#define COMMRAM_LOAD(cell) __atomic_load_n(&(cell), __ATOMIC_SEQ_CST)
#define COMMRAM_STORE(cell, value) __atomic_store_n(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_ADD(cell, value) __atomic_fetch_add(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_SUB(cell, value) __atomic_fetch_sub(&(cell), (value), __ATOMIC_SEQ_CST)
#define COMMRAM_SWAP_IF(cell, expected, value)                                                                   \
    __atomic_compare_exchange_n(&(cell), (expected), (value), false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST)
extern "C" {
#else
#include <stdatomic.h>
#define COMMRAM_CELL(type) volatile _Atomic(type)
#define COMMRAM_LOAD(cell) atomic_load(&(cell))
#define COMMRAM_STORE(cell, value) atomic_store(&(cell), (value))
#define COMMRAM_ADD(cell, value) atomic_fetch_add(&(cell), (value))
#define COMMRAM_SUB(cell, value) atomic_fetch_sub(&(cell), (value))
#define COMMRAM_SWAP_IF(cell, expected, value) atomic_compare_exchange_strong(&(cell), (expected), (value))
#endif

