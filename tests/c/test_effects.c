/* SPDX-License-Identifier: MIT
 *
 * The tables of effects and methods, seen from inside the core: what is off is not there, an effect
 * without derivatives is refused by implicit methods, and methods fit into a stepper.
 */
#include <math.h>
#include <stdlib.h>

#include "check.h"
#include "run/run.h"
#include "scene.h"

/* As test_scene, with drag or without it. */
static bd_sim *make(bd_pulley pulleys[NP], int drag, bd_model **model) {
  static room r;
  static bd_state state;
  bd_scene scene = test_scene();
  bd_sim *sim = NULL;
  for (int j = 0; j < NP; ++j) {
    pulleys[j] = test_pulleys[j];
    pulleys[j].drag = drag ? pulleys[j].drag : (bd_drag){0};
  }
  scene.pulleys = pulleys;
  state = state_in(&r);
  CHECK(bd_model_create(model, &scene, NULL) == BD_OK);
  CHECK(settle_into(*model, &state, NULL) == BD_OK);
  bd_options options;
  bd_options_default(&options);
  options.method = "rodas4";
  CHECK(bd_sim_create(&sim, *model, &state, NULL, 1e-3, &options, NULL) == BD_OK);
  return sim;
}

/* Bytes of a simulation's block. */
static size_t bytes(const bd_model *model) {
  bd_carver carver = {0};
  bd_stepper sizes;
  const bd_method *method = bd_method_find("rodas4");
  bd_stepper_carve(&carver, &sizes, model, method, NULL, NULL);
  return carver.used;
}

static int has(const bd_sim *sim, const char *name) {
  int found = 0;
  for (int k = 0; bd_sim_pass(sim, k); ++k) {
    found += strcmp(bd_sim_pass(sim, k), name) == 0;
  }
  return found;
}

static void what_is_off_is_not_there(void) {
  bd_pulley pulleys[NP];
  bd_model *with = NULL, *without = NULL;
  bd_sim *on = make(pulleys, 1, &with), *off = make(pulleys, 0, &without);
  CHECK(has(on, "bearing drag") == 1 && has(off, "bearing drag") == 0);
  CHECK(on->stepper.plan.n_effects == off->stepper.plan.n_effects + 1);
  CHECK(with->drag && on->stepper.newton.at.pulley_damping);
  CHECK(!without->drag && !off->stepper.newton.at.pulley_damping);
  CHECK(with->lay.n_work == W_drag_loss + 1 && without->lay.n_work == W_drag_loss);
  CHECK(without->lay.work + without->lay.n_work <= (int)without->lay.size);
  CHECK(bytes(without) < bytes(with));
  int terms[BD_N_ENERGY];
  CHECK(bd_model_energy_terms(without, terms) == BD_ENERGY_residual + 1);
  for (int c = 0; c <= BD_ENERGY_residual; ++c) {
    CHECK(terms[c] == c);
  }
  CHECK(bd_model_energy_terms(with, terms) == BD_ENERGY_residual + 2);
  CHECK(terms[BD_ENERGY_residual + 1] == BD_ENERGY_drag_loss);
  CHECK(bd_model_energy_terms(with, NULL) == BD_ENERGY_residual + 2);
  bd_sim_free(on);
  bd_sim_free(off);
  bd_model_free(with);
  bd_model_free(without);
}

/* Bytes of a state and of a simulation; the friction slots of a drive with these laws. */
static int slots_of(const bd_friction *friction, const bd_friction *own, size_t *state,
                    size_t *all) {
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model = NULL;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  pulleys[1].friction = own;
  scene.pulleys = pulleys;
  scene.friction = friction;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  const int slots = model->lay.slots;
  *state = model->lay.size * sizeof(double);
  *all = bytes(model);
  bd_model_free(model);
  return slots;
}

/* A drive without friction has no state of it; with any law, on all pulleys or on one, two fields
 * more, of laws without a state one; the linear systems have rows of states only for pulleys whose
 * law has one, and more arrays only for pulleys whose law is a general one. */
static void friction_costs_what_it_needs(void) {
  size_t none, all_none, one, all_one, two, all_two;
  CHECK(slots_of(NULL, NULL, &none, &all_none) == 0);
  CHECK(slots_of(&test_friction, NULL, &one, &all_one) == 1);
  CHECK(one > none && one - none <= 2 * 8 * (BD_HALO + N + 1 + BD_LANES) && all_one > all_none);
  CHECK(slots_of(NULL, &test_friction, &two, &all_two) == 1);
  CHECK(two == one && all_none < all_two && all_two < all_one);
  const bd_friction stateless[] = {
      {BD_LAW_coulomb, .coulomb = {0.8, 0.1, 0.0, 0.0}},
      {BD_LAW_creep_rate, .creep_rate = {0.8, 0.1}},
      {BD_LAW_threlfall, .threlfall = {0.8, 0.2}},
  };
  for (int k = 0; k < 3; ++k) {
    CHECK(slots_of(&stateless[k], NULL, &two, &all_two) == 1);
    CHECK(2 * (two - none) == one - none && all_none < all_two && all_two < all_one);
  }
  const bd_friction others[] = {
      {BD_LAW_elastic_plastic, .elastic_plastic = {0.8, 2e7, 400.0, 0.0, 0.0}},
      {BD_LAW_lugre, .lugre = {0.6, 0.8, 0.05, 1e4, 0.1, 0.02}},
  };
  for (int k = 0; k < 2; ++k) {
    size_t shared, all_shared;
    CHECK(slots_of(&test_friction, &others[k], &two, &all_two) == 1);
    /* along links derivatives take as much of any law */
    CHECK(two == one && (TEST_MESH == BD_MESH_JOINT ? all_two == all_one : all_two > all_one));
    CHECK(slots_of(&others[k], NULL, &shared, &all_shared) == 1);
    CHECK(shared == one && all_shared - all_one == NP * (all_two - all_one));
  }
}

/* A drive without mounts has no travel in its state, no pass, no scratch and no column of the
 * ledger for them; contact of the links' centres knows none. */
static void mounts_cost_what_they_need(void) {
  static room r;
  const bd_mount slider = {
      .kind = BD_MOUNT_SLIDER,
      .slider = {.mass = 2.0, .stiffness = 4e5, .preload = 200.0, .friction = 10.0},
      .direction = {1.0, -0.3}};
  bd_pulley pulleys[NP];
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  pulleys[2].mount = &slider;
  bd_scene scene = test_scene();
  bd_model *without = NULL, *with = NULL;
  bd_error err;
  CHECK(bd_model_create(&without, &scene, NULL) == BD_OK);
  scene.pulleys = pulleys;
  const int code = bd_model_create(&with, &scene, &err);
  if (TEST_MESH != BD_MESH_JOINT) {
    CHECK(code == BD_ERR_PARAMETER && strcmp(err.field, "pulleys[2].mount") == 0);
    bd_model_free(without);
    return;
  }
  CHECK(code == BD_OK && bd_model_check_geometry(with, &err) == BD_OK);
  CHECK(!without->mounts && !without->mount_of && without->lay.nm == 0 && with->lay.nm == 1);
  CHECK(without->lay.work == without->lay.omega + NP);
  CHECK(with->lay.work == with->lay.omega + NP + 3 && with->lay.n_work == MAX_WORK);
  CHECK(bytes(without) < bytes(with));
  const int own = bd_model_energy_terms(with, NULL) - bd_model_energy_terms(without, NULL);
  CHECK(own == 2);
  bd_state state = state_in(&r);
  double travel[1] = {0.0}, speed[1] = {0.0}, share[1] = {0.0}, rest[1];
  state.travel = travel;
  state.travel_speed = speed;
  state.mount_friction = share;
  CHECK(settle_into(with, &state, &err) == BD_OK);
  bd_model_rest(with, rest);
  CHECK(fabs(rest[0] - travel[0]) < 0.03 * with->info.link_length && speed[0] == 0.0 &&
        fabs(share[0]) < 1.0);
  bd_sim *sim = NULL;
  bd_options options;
  bd_options_default(&options);
  options.method = "rodas4";
  CHECK(bd_sim_create(&sim, with, &state, NULL, 2e-3, &options, &err) == BD_OK);
  CHECK(has(sim, "axes on mounts") == 1 && has(sim, "mounts: sliders") == 1);
  CHECK(sim->stepper.plan.hub && sim->stepper.newton.at.mounts);
  CHECK(bd_sim_advance(sim, 100000, &err) == BD_OK && bd_sim_state(sim, &state) == BD_OK);
  CHECK(fabs(travel[0] - rest[0]) < 1e-3);
  bd_sim_free(sim);
  bd_model_free(with);
  bd_model_free(without);
}

static void without_derivatives_refused(void) {
  bd_pulley pulleys[NP];
  bd_model *model = NULL;
  bd_error err;
  bd_sim *sim = make(pulleys, 1, &model);
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

static const test tests[] = {
    {"what_is_off_is_not_there", what_is_off_is_not_there},
    {"friction_costs_what_it_needs", friction_costs_what_it_needs},
    {"mounts_cost_what_they_need", mounts_cost_what_they_need},
    {"without_derivatives_refused", without_derivatives_refused},
    {"methods_have_room", methods_have_room},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, (int)(sizeof tests / sizeof tests[0]));
}
