/* SPDX-License-Identifier: MIT
 *
 * The tables of effects and methods, seen from inside the core: friction takes the room that its
 * laws need (other effects: tests/test_off_is_free.py), an effect without derivatives is refused by
 * implicit methods, and methods fit into a stepper.
 */
#include <stdlib.h>

#include "check.h"
#include "run/run.h"
#include "scene.h"

/* Numbers of a state and bytes of a simulation of a drive with these laws. */
typedef struct room_taken {
  size_t state, all;
} room_taken;

static room_taken taken_by(const bd_friction *friction, const bd_friction *own) {
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model = NULL;
  bd_carver carver = {0};
  bd_stepper sizes;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  pulleys[1].friction = own;
  scene.pulleys = pulleys;
  scene.friction = friction;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  CHECK(model->lay.slots == (friction || own));
  bd_stepper_carve(&carver, &sizes, model, bd_method_find("rodas4"), NULL, NULL);
  const room_taken taken = {model->lay.size, carver.used};
  bd_model_free(model);
  return taken;
}

/* A drive without friction has no state of it; with any law, on all pulleys or on one, two fields
 * more, of laws without a state one; the linear systems have rows of states only for pulleys whose
 * law has one, as many for any law of one state. */
static void friction_costs_what_it_needs(void) {
  const room_taken none = taken_by(NULL, NULL), all = taken_by(&test_friction, NULL);
  const room_taken one = taken_by(NULL, &test_friction);
  CHECK(all.state > none.state && all.state - none.state <= 2 * (BD_HALO + N + 1 + 2 * BD_LANES));
  CHECK(one.state == all.state && none.all < one.all && one.all < all.all);
  const bd_friction stateless[] = {
      {BD_LAW_coulomb, .coulomb = {0.8, 0.1, 0.0, 0.0}},
      {BD_LAW_creep_rate, .creep_rate = {0.8, 0.1}},
      {BD_LAW_threlfall, .threlfall = {0.8, 0.2}},
  };
  for (int k = 0; k < 3; ++k) {
    const room_taken law = taken_by(&stateless[k], NULL);
    CHECK(2 * (law.state - none.state) == all.state - none.state);
    CHECK(none.all < law.all && law.all < all.all);
  }
  const bd_friction general[] = {
      {BD_LAW_elastic_plastic, .elastic_plastic = {0.8, 2e7, 400.0, 0.0, 0.0}},
      {BD_LAW_lugre, .lugre = {0.6, 0.8, 0.05, 1e4, 0.1, 0.02}},
  };
  for (int k = 0; k < 2; ++k) {
    const room_taken own = taken_by(&test_friction, &general[k]);
    const room_taken law = taken_by(&general[k], NULL);
    CHECK(own.state == all.state && law.state == all.state);
    CHECK(own.all == all.all && law.all == all.all);
  }
}

static void without_derivatives_refused(void) {
  static room r;
  bd_error err;
  bd_sim *sim = NULL;
  bd_state state = state_in(&r);
  bd_model *model = settled_drive(&state);
  CHECK(bd_sim_create(&sim, model, &state, NULL, 1e-3, NULL, NULL) == BD_OK);
  bd_plan *plan = &sim->stepper.plan;
  CHECK(bd_newton_check(plan, "rodas4", &err) == BD_OK);
  bd_effect own = *plan->effects[1];
  own.name = "an effect of its own";
  own.tangent = NULL;
  plan->effects[1] = &own;
  CHECK(bd_newton_check(plan, "rodas4", &err) == BD_ERR_OPTION);
  CHECK(strcmp(err.field, "method") == 0);
  CHECK(strstr(err.message, "an effect of its own") && strstr(err.message, "rodas4"));
  bd_sim_free(sim);
  bd_model_free(model);
}

/* The arrays of a stepper have room for what the methods say they need. */
static void methods_have_room(void) {
  size_t n = 0;
  for (const bd_method *method; (method = bd_method_at(n)); ++n) {
    CHECK(method->vectors >= 2 && method->vectors <= MAX_VECTORS);
    CHECK(method->history >= 0 && method->history <= MAX_HISTORY);
    CHECK(bd_method_find(method->name) == method);
    CHECK(strcmp(bd_method_name(n + 1), method->name) == 0);
  }
  CHECK(n >= 5 && strcmp(bd_method_name(0), "auto") == 0 && !bd_method_name(n + 1));
}

/* Blocks of the state an even number of cache lines apart crowd into few sets of the cache: at 240
 * links a step took up to a tenth longer. */
static void blocks_do_not_share_cache_sets(void) {
  for (int n = N; n < N + 600; ++n) {
    bd_scene scene = test_scene();
    bd_model *model = NULL;
    scene.belt.n_bodies = n;
    CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
    CHECK(model->lay.stride % (2 * BD_LANES) == BD_LANES);
    bd_model_free(model);
  }
}

static const test tests[] = {
    {"friction_costs_what_it_needs", friction_costs_what_it_needs},
    {"without_derivatives_refused", without_derivatives_refused},
    {"methods_have_room", methods_have_room},
    {"blocks_do_not_share_cache_sets", blocks_do_not_share_cache_sets},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 4);
}
