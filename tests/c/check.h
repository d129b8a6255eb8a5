/* SPDX-License-Identifier: MIT
 *
 * A test program is a table of named functions; `./program NAME` runs one, no argument all. CHECK
 * says what failed and where, and counts.
 */
#ifndef CHECK_H
#define CHECK_H

#include <stdio.h>
#include <string.h>

static int failures;

#define CHECK(condition)                                                                           \
  do {                                                                                             \
    if (!(condition)) {                                                                            \
      ++failures;                                                                                  \
      printf("%s:%d: %s\n", __FILE__, __LINE__, #condition);                                       \
    }                                                                                              \
  } while (0)

typedef struct test {
  const char *name;
  void (*run)(void);
} test;

static int run_tests(int argc, char **argv, const test *tests, int n) {
  int ran = 0;
  for (int k = 0; k < n; ++k) {
    if (argc < 2 || strcmp(argv[1], tests[k].name) == 0) {
      tests[k].run();
      ++ran;
    }
  }
  printf("%d tests, %d failures\n", ran, failures);
  return ran == 0 || failures > 0;
}

#endif
