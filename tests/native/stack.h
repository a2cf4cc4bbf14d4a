/* stack.h - measures the stack of a call: it runs in a thread of 64 kB whose memory was painted
 * before. The limits and the figures are in docs/architecture.md. */
#ifndef HX_TESTS_STACK_H
#define HX_TESTS_STACK_H

#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "check.h"

enum {
  STACK = 64 * 1024,       /* bytes, with what the system needs of it */
  ALLOWED = 48 * 1024,     /* for a call */
  BEYOND = 4 * STACK,      /* memory below the stack, so that a call that needs more is measured */
  SANITIZED = 1024 * 1024, /* sanitizers enlarge frames, so that nothing is measured then */
  PAINT = 0xA5
};

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define HX_SANITIZED
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define HX_SANITIZED
#endif

/* A call and its argument. */
typedef struct {
  void (*run)(void *);
  void *argument;
} StackCall;

static inline void *run_call(void *call) {
  const StackCall *given = call;
  given->run(given->argument);
  return NULL;
}

static inline void do_nothing(void *unused) { (void)unused; }

/* Runs a call in a thread of its own; returns how many bytes of its stack were written. */
static inline long stack_of(void (*run)(void *), void *argument) {
  static _Alignas(4096) unsigned char memory[BEYOND + STACK];
  StackCall call = {run, argument};
  pthread_attr_t attributes;
  pthread_t thread;
  long untouched = 0;
  memset(memory, PAINT, sizeof memory);
  CHECK(pthread_attr_init(&attributes) == 0);
#ifdef HX_SANITIZED
  CHECK(pthread_attr_setstacksize(&attributes, SANITIZED) == 0);
#else
  CHECK(pthread_attr_setstack(&attributes, memory + BEYOND, STACK) == 0);
#endif
  CHECK(pthread_create(&thread, &attributes, run_call, &call) == 0);
  CHECK(pthread_join(thread, NULL) == 0);
  CHECK(pthread_attr_destroy(&attributes) == 0);
  while (untouched < (long)sizeof memory && memory[untouched] == PAINT) ++untouched;
  return (long)sizeof memory - untouched;
}

/* Runs a call in a small thread, prints its stack and checks it. */
static inline void in_small_stack(const char *what, void (*run)(void *), void *argument) {
  const long used = stack_of(run, argument) - stack_of(do_nothing, NULL);
  printf("%-40s %6.1f kB\n", what, (double)used / 1000.0);
  CHECK(used <= ALLOWED);
}

#endif
