/* SPDX-License-Identifier: MIT
 *
 * How many exponentials the core computes, settling and running: none, unless friction has a
 * Stribeck curve, or is Threlfall's. Built with BD_COUNT_EXPONENTIALS.
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

/* Every law with a curve, without one (0), and where its coefficients are equal. What a law says is
 * evaluated at samples only if it was asked for. */
static void only_a_stribeck_curve_needs_them(void) {
  const double statics[] = {0.0, 0.8, 1.0};
  for (int k = 0; k < 3; ++k) {
    const double s = statics[k], v = s > 0.0 ? 0.05 : 0.0;
    const bd_friction laws[] = {
        {BD_LAW_dahl, .dahl = {0.8, 1e4, s, v}},
        {BD_LAW_elastic_plastic, .elastic_plastic = {0.8, 2e7, 400.0, s, v}},
        {BD_LAW_coulomb, .coulomb = {0.8, 0.1, s, v}},
        {BD_LAW_maxwell_slip,
         .maxwell_slip = {{2, {0.5, 0.3}}, {2, {2e7, 1e7}}, {2, {400.0, 300.0}}, s, v}},
        {BD_LAW_lugre, .lugre = {0.8, s > 0.0 ? s : 0.8, 0.05, 1e4, 0.1, 0.02}}};
    for (int j = 0; j < 5; ++j) {
      CHECK((counted(&laws[j], NULL) > 0) == (s > 0.8));
      CHECK((counted(NULL, &laws[j]) > 0) == (s > 0.8));
      CHECK((counted(&test_friction, &laws[j]) > 0) == (s > 0.8));
    }
  }
  const bd_friction creep_rate = {BD_LAW_creep_rate, .creep_rate = {0.8, 0.1}};
  const bd_friction threlfall = {BD_LAW_threlfall, .threlfall = {0.8, 0.2}};
  CHECK(counted(NULL, NULL) == 0 && counted(&creep_rate, NULL) == 0);
  const long unsampled = counted_with(&threlfall, NULL, NOTHING);
  CHECK(unsampled > 0 && counted_with(&threlfall, NULL, NORMAL) == unsampled);
  CHECK(counted_with(&threlfall, NULL, MU) > unsampled);
}

static const test tests[] = {
    {"only_a_stribeck_curve_needs_them", only_a_stribeck_curve_needs_them}};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 1);
}
