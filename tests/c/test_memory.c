/* SPDX-License-Identifier: MIT
 *
 * Every allocation fails in turn: a clear error, nothing leaked, nothing crashed. base.c is built
 * with BD_MALLOC=counting_malloc and BD_FREE=counting_free.
 */
#include <stdlib.h>

#include "check.h"
#include "scene.h"

void *counting_malloc(size_t size);
void counting_free(void *block);

static long asked, fail_at, alive;
static int running;

void *counting_malloc(size_t size) {
  CHECK(!running); /* no allocation while running */
  if (++asked == fail_at) {
    return NULL;
  }
  ++alive;
  return malloc(size);
}

void counting_free(void *block) {
  --alive;
  free(block);
}

/* A whole session: model, settling from a slack position, run with samples. */
static int session(bd_error *err) {
  static room r;
  static double force[11 * N];
  bd_model *model = NULL;
  bd_sim *sim = NULL;
  bd_settling *settling = NULL;
  bd_scene scene = test_scene();
  bd_state state = state_in(&r);
  const double offset[2 * NP] = {0, 0, -2e-3, -2e-3, 0, 0};
  bd_settle_options options;
  bd_settle_options_default(&options);
  options.offset = offset;
  options.move_time = 0.01;
  options.friction = 1;
  int code = bd_model_create(&model, &scene, err);
  if (code == BD_OK) {
    code = bd_settle_create(&settling, model, NULL, &options, err);
  }
  if (code == BD_OK) {
    running = 1;
    code = come_to_rest(settling, err);
    running = 0;
    bd_sim_state(bd_settle_sim(settling), &state);
  }
  bd_settle_free(settling);
  const double drag[NP] = {1, 1, 1}, t[] = {0, 1e-3}, values[2 * NP] = {0, 0, 0, -5, 0, 0};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_VISCOUS, .coefficients = drag},
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = t, .values = values},
      {.kind = BD_TORQUE_LOAD, .pulley = 1, .against = {1, 1, 1}, .n_t = 2, .t = t, .values = drag},
      {.kind = BD_TORQUE_TABLE, .pulley = 1, .n_points = 1, .omega = drag, .torque = drag},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {2, drag, drag, drag}}};
  const bd_motion motion = {
      .pulley = 2, .n_t = 1, .t = t, .values = values, .harmonics = {1, drag, drag, drag}};
  const bd_torque torque = {.n_terms = 5, .terms = terms, .n_motions = 1, .motions = &motion};
  if (code == BD_OK) {
    code = bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, err);
  }
  if (code == BD_OK) {
    double times[11];
    for (int k = 0; k < 11; ++k) {
      times[k] = 2e-4 * k;
    }
    times[10] = 2e-3;
    const bd_output out = {.force = force};
    code = bd_sim_set_output(sim, 11, times, &out, err);
  }
  if (code == BD_OK) {
    running = 1;
    code = finish(sim, err);
    running = 0;
  }
  if (code == BD_OK) {
    static room r2;
    bd_state rate = state_in(&r2);
    const double none[NP] = {0};
    code = bd_model_rate(model, &state, none, &rate, err);
  }
  bd_sim_free(sim);
  bd_model_free(model);
  return code;
}

static void every_allocation_may_fail(void) {
  bd_error err;
  fail_at = 0;
  asked = 0;
  CHECK(session(&err) == BD_OK);
  long total = asked;
  CHECK(total >= 5);
  CHECK(alive == 0);
  for (fail_at = 1; fail_at <= total; ++fail_at) {
    asked = 0;
    CHECK(session(&err) == BD_ERR_MEMORY);
    CHECK(strstr(err.message, "out of memory") != NULL);
    CHECK(alive == 0);
  }
}

static const test tests[] = {{"every_allocation_may_fail", every_allocation_may_fail}};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 1);
}
