/* SPDX-License-Identifier: MIT
 *
 * Threads that share one constant model, each with simulations of its own: the same bits in all,
 * and under ThreadSanitizer no race.
 */
#include <pthread.h>

#include "check.h"
#include "scene.h"

enum { THREADS = 4 };

typedef struct job {
  const bd_model *model;
  const bd_state *start;
  room end;
  int code;
} job;

static void *work(void *argument) {
  job *own = argument;
  bd_error err;
  bd_info info;
  bd_state settled = state_in(&own->end), end = settled;
  bd_sim *sim = NULL;
  bd_model_info(own->model, &info);
  own->code = settle_into(own->model, &settled, &err);
  if (own->code == BD_OK) {
    own->code = bd_sim_create(&sim, own->model, own->start, NULL, 2e-3, NULL, &err);
  }
  if (own->code == BD_OK) {
    own->code = finish(sim, &err);
  }
  if (own->code == BD_OK) {
    own->code = bd_sim_state(sim, &end);
  }
  bd_sim_free(sim);
  return NULL;
}

static void threads_share_a_model(void) {
  static room r;
  static job jobs[THREADS];
  pthread_t threads[THREADS];
  bd_state start = state_in(&r);
  bd_model *model = settled_drive(&start);
  CHECK(model != NULL);
  for (int k = 0; k < THREADS; ++k) {
    jobs[k] = (job){.model = model, .start = &start};
    CHECK(pthread_create(&threads[k], NULL, work, &jobs[k]) == 0);
  }
  for (int k = 0; k < THREADS; ++k) {
    pthread_join(threads[k], NULL);
    CHECK(jobs[k].code == BD_OK);
    CHECK(memcmp(&jobs[k].end, &jobs[0].end, sizeof jobs[k].end) == 0);
  }
  bd_model_free(model);
}

static const test tests[] = {{"threads_share_a_model", threads_share_a_model}};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 1);
}
