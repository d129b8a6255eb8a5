/* SPDX-License-Identifier: MIT
 *
 * Forgets its model: shows that the sanitized build sees a leak.
 */
#include "scene.h"

int main(void) {
  bd_model *model;
  bd_scene scene = test_scene();
  const int code = bd_model_create(&model, &scene, NULL);
  model = NULL;
  return code;
}
