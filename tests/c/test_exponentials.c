/* SPDX-License-Identifier: MIT
 *
 * How many exponentials the core computes, settling and running: none, unless friction has a
 * Stribeck curve, or is Threlfall's. Built with BD_COUNT_EXPONENTIALS by tests/test_c.py.
 */
#include "check.h"
#include "scene.h"

long bd_exponentials; /* counted by kernels/vector.h */

enum { MU, NORMAL, NOTHING };

/* All of a drive that has this friction: at rest, by every kind of method, sampled. */
static long counted_with(const bd_friction *friction, const bd_friction *own, int asked) {
  static room r;
  static double values[2 * N];
  const double t[] = {0.0, 1e-3}, torque_values[2][NP] = {{0}, {-20.0, 2.0, 0.0}};
  const bd_torque_term term = {
      .kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = t, .values = torque_values[0]};
  const bd_torque torque = {.n_terms = 1, .terms = &term};
  const char *const methods[] = {"tsit5", "rk4", "rodas4", "lbdf2", "lie", "auto"};
  const bd_output out = {.mu = asked == MU ? values : NULL,
                         .normal = asked == NORMAL ? values : NULL};
  bd_pulley pulleys[NP];
  bd_scene scene = test_scene();
  bd_model *model = NULL;
  bd_state state = state_in(&r);
  bd_options options;
  memcpy(pulleys, test_pulleys, sizeof pulleys);
  pulleys[1].friction = own;
  scene.pulleys = pulleys;
  scene.friction = friction;
  bd_exponentials = 0;
  CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
  CHECK(settle_into(model, &state, NULL) == BD_OK);
  bd_options_default(&options);
  for (int k = 0; k < 6; ++k) {
    bd_sim *sim = NULL;
    options.method = methods[k];
    CHECK(bd_sim_create(&sim, model, &state, &torque, 1e-3, &options, NULL) == BD_OK);
    CHECK(bd_sim_set_output(sim, 2, t, &out, NULL) == BD_OK);
    CHECK(finish(sim, NULL) == BD_OK);
    bd_sim_free(sim);
  }
  bd_model_free(model);
  return bd_exponentials;
}

static long counted(const bd_friction *friction, const bd_friction *own) {
  return counted_with(friction, own, MU);
}

/* What a law says is evaluated at samples only if it was asked for. */
static void outputs_of_friction_are_evaluated_on_demand(void) {
  const bd_friction stribeck = {BD_LAW_lugre, .lugre = {0.6, 0.8, 0.05, 1e4, 0.1, 0.02}};
  const long none = counted_with(&stribeck, NULL, NOTHING);
  CHECK(counted_with(&stribeck, NULL, NORMAL) == none);
  CHECK(counted_with(&stribeck, NULL, MU) > none);
}

static void only_a_stribeck_curve_needs_them(void) {
  const bd_friction dahl = test_friction;
  const bd_friction plastic = {BD_LAW_elastic_plastic,
                               .elastic_plastic = {0.8, 2e7, 400.0, 0.0, 0.0}};
  const bd_friction plain = {BD_LAW_lugre, .lugre = {0.8, 0.8, 0.05, 1e4, 0.1, 0.02}};
  const bd_friction stribeck = {BD_LAW_lugre, .lugre = {0.6, 0.8, 0.05, 1e4, 0.1, 0.02}};
  const bd_friction coulomb = {BD_LAW_coulomb, .coulomb = {0.8, 0.1, 0.0, 0.0}};
  const bd_friction creep_rate = {BD_LAW_creep_rate, .creep_rate = {0.8, 0.1}};
  const bd_friction threlfall = {BD_LAW_threlfall, .threlfall = {0.8, 0.2}};
  const bd_friction maxwell = {
      BD_LAW_maxwell_slip,
      .maxwell_slip = {{2, {0.5, 0.3}}, {2, {2e7, 1e7}}, {2, {400.0, 300.0}}, 0.0, 0.0}};
  const bd_friction *const without[] = {NULL,     &dahl,       &plastic, &plain,
                                        &coulomb, &creep_rate, &maxwell};
  for (int j = 0; j < 7; ++j) {
    for (int k = 0; k < 7; ++k) {
      CHECK(counted(without[j], without[k]) == 0);
    }
    CHECK(counted(without[j], &stribeck) > 0);
  }
  CHECK(counted(&stribeck, NULL) > 0);
  CHECK(counted(&threlfall, NULL) > 0);
}

/* Equal coefficients are no curve. */
static void every_law_with_a_stribeck_curve_needs_them(void) {
  for (int equal = 0; equal < 2; ++equal) {
    const double mu_s = equal ? 0.75 : 1.0;
    const bd_friction laws[] = {
        {BD_LAW_dahl, .dahl = {0.75, 1e4, mu_s, 0.05}},
        {BD_LAW_elastic_plastic, .elastic_plastic = {0.75, 2e7, 400.0, mu_s, 0.05}},
        {BD_LAW_coulomb, .coulomb = {0.75, 0.1, mu_s, 0.05}},
        {BD_LAW_maxwell_slip,
         .maxwell_slip = {{2, {0.5, 0.25}}, {2, {2e7, 1e7}}, {2, {400.0, 300.0}}, mu_s, 0.05}}};
    for (int k = 0; k < 4; ++k) {
      CHECK((counted(&laws[k], NULL) == 0) == equal);
    }
  }
}

static const test tests[] = {
    {"only_a_stribeck_curve_needs_them", only_a_stribeck_curve_needs_them},
    {"every_law_with_a_stribeck_curve_needs_them", every_law_with_a_stribeck_curve_needs_them},
    {"outputs_of_friction_are_evaluated_on_demand", outputs_of_friction_are_evaluated_on_demand},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 3);
}
