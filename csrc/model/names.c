/* SPDX-License-Identifier: MIT
 *
 * Names of pulleys: their rules, and what messages call a pulley.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

/* Of what messages call one pulley: pulley "...". */
enum { LONGEST = BD_MAX_NAME + 9 };

static int check_name(const bd_pulley *pulleys, int j, bd_error *err) {
  const char *name = pulleys[j].name, *rule = NULL;
  if (!name) {
    return BD_OK;
  }
  const size_t length = strlen(name);
  if (length == 0 || length > BD_MAX_NAME) {
    rule = length == 0 ? "must not be empty" : "is too long";
  }
  for (size_t k = 0; !rule && k < length; ++k) {
    const unsigned char byte = (unsigned char)name[k];
    rule = byte < ' ' || byte == 127 ? "must be printable" : NULL;
  }
  char field[40];
  snprintf(field, sizeof field, "pulleys[%d].name", j);
  if (rule) {
    return bd_fail_at(err, BD_ERR_PARAMETER, field, (double)NAN, -1, j, (double)length,
                      "%s %s: 1 to %d bytes of UTF-8 are allowed, got %zu", field, rule,
                      BD_MAX_NAME, length);
  }
  for (int k = 0; k < j; ++k) {
    if (pulleys[k].name && strcmp(pulleys[k].name, name) == 0) {
      return bd_fail_at(err, BD_ERR_PARAMETER, field, (double)NAN, -1, j, (double)NAN,
                        "pulleys[%d].name and %s must differ, both are \"%s\"", k, field, name);
    }
  }
  return BD_OK;
}

int bd_names_check(const bd_scene *scene, bd_error *err) {
  int code = BD_OK;
  for (int j = 0; code == BD_OK && j < scene->n_pulleys; ++j) {
    code = check_name(scene->pulleys, j, err);
  }
  return code;
}

void bd_names_copy(bd_name *names, int np, const bd_pulley *pulleys) {
  for (int j = 0; j < np; ++j) {
    snprintf(names[j].text, sizeof names[j].text, "%s", pulleys[j].name ? pulleys[j].name : "");
  }
}

static int is_named(const bd_model *model, int j) {
  return j >= 0 && j < model->lay.np && model->name[j].text[0];
}

bd_label bd_pulley_label(const bd_model *model, int pulley) {
  bd_label label;
  if (is_named(model, pulley)) {
    snprintf(label.text, sizeof label.text, "pulley \"%s\"", model->name[pulley].text);
  } else {
    snprintf(label.text, sizeof label.text, "pulley %d", pulley);
  }
  return label;
}

bd_label bd_body_label(const bd_model *model, int body) {
  bd_label label;
  snprintf(label.text, sizeof label.text, "%s %d", model->belt_model->facts.flows ? "cell" : "link",
           body);
  return label;
}

bd_label bd_pulleys_label(const bd_model *model, int j, int k) {
  bd_label label;
  if (is_named(model, j) || is_named(model, k)) {
    snprintf(label.text, sizeof label.text, "%.*s and %.*s", LONGEST,
             bd_pulley_label(model, j).text, LONGEST, bd_pulley_label(model, k).text);
  } else {
    snprintf(label.text, sizeof label.text, "pulleys %d and %d", j, k);
  }
  return label;
}

bd_label bd_links_label(double least) {
  bd_label label = {"no number of links"};
  if (least <= BD_MAX_LINKS) {
    snprintf(label.text, sizeof label.text, "belt.n_bodies >= %.0f", ceil(least));
  }
  return label;
}
