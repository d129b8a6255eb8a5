/* SPDX-License-Identifier: MIT
 *
 * The parameters of a scene as a table, from the lists of fields.h and the friction laws, and their
 * rules. Python's classes are checked here, too.
 */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

enum {
#define X(rule, wording, least, above, most) RULE_##rule,
  BD_RULES(X)
#undef X
};

static const struct {
  const char *wording;
  double least;
  int above;
  double most;
} rules[] = {
#define X(rule, wording, least, above, most) {wording, least, above, most},
    BD_RULES(X)
#undef X
};

const bd_parameter bd_parameters[] = {
#define X(group, name, rule, unit, text)                                                           \
  {#group,                                                                                         \
   #name,                                                                                          \
   unit,                                                                                           \
   text,                                                                                           \
   RULE_##rule,                                                                                    \
   _Generic(((bd_##group *)0)->name, double                                                        \
            : BD_IS_NUMBER, int                                                                    \
            : BD_IS_INTEGER, bd_numbers                                                            \
            : BD_IS_LIST),                                                                         \
   offsetof(bd_##group, name)},
    BD_PARAMETERS(X)
#undef X
};

enum { N_PARAMETERS = sizeof bd_parameters / sizeof bd_parameters[0] };
const size_t bd_n_parameters = N_PARAMETERS;

/* Of a number 1. */
static int list_length(const bd_parameter *row, const void *group) {
  int n = 1;
  if (row->kind == BD_IS_LIST) {
    memcpy(&n, (const char *)group + row->offset + offsetof(bd_numbers, n), sizeof n);
  }
  return n;
}

int bd_parameter_values(const bd_parameter *row, const void *group, double *values) {
  const char *field = (const char *)group + row->offset;
  const int n = list_length(row, group);
  int count;
  if (row->kind == BD_IS_INTEGER) {
    memcpy(&count, field, sizeof count);
    values[0] = count;
  } else {
    field += row->kind == BD_IS_LIST ? offsetof(bd_numbers, at) : 0;
    memcpy(values, field, (size_t)n * sizeof *values);
  }
  return n;
}

int bd_parameters_list_length(const char *group, const void *record) {
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    if (bd_parameters[k].kind == BD_IS_LIST && strcmp(bd_parameters[k].group, group) == 0) {
      return list_length(&bd_parameters[k], record);
    }
  }
  return 0;
}

uint64_t bd_parameters_sum(uint64_t sum, const char *group, const void *record) {
  double values[BD_MAX_ELEMENTS];
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    if (strcmp(bd_parameters[k].group, group) == 0) {
      const int n = bd_parameter_values(&bd_parameters[k], record, values);
      sum = bd_check_sum(sum, values, (size_t)n * sizeof *values);
    }
  }
  return bd_check_sum(sum, group, strlen(group));
}

uint64_t bd_scene_sum(const bd_scene *scene) {
  uint64_t sum = bd_parameters_sum(BD_NOTHING, "belt", &scene->belt);
  sum = bd_parameters_sum(sum, "contact", &scene->contact);
  sum = bd_check_sum(sum, &scene->belt.mesh, sizeof scene->belt.mesh);
  sum = bd_check_sum(sum, scene->gravity, sizeof scene->gravity);
  for (int j = 0; j < scene->n_pulleys; ++j) {
    const bd_pulley *pulley = &scene->pulleys[j];
    const bd_friction *friction = pulley->friction ? pulley->friction : scene->friction;
    sum = bd_parameters_sum(sum, "pulley", pulley);
    sum = bd_parameters_sum(sum, "drag", &pulley->drag);
    sum = bd_check_sum(sum, pulley->center, sizeof pulley->center);
    sum = bd_check_sum(sum, &pulley->outside, sizeof pulley->outside);
    sum = friction && friction->law != BD_LAW_NONE
              ? bd_parameters_sum(sum, bd_law_name(friction->law), &friction->dahl)
              : sum;
  }
  return sum;
}

static int check(const bd_parameter *row, const char *label, double value, bd_error *err) {
  const double least = rules[row->rule].least;
  if (isfinite(value) && (rules[row->rule].above ? value > least : value >= least) &&
      value <= rules[row->rule].most) {
    return BD_OK;
  }
  const int bare = strcmp(row->unit, "1") == 0;
  char field[64];
  snprintf(field, sizeof field, "%s.%s", label, row->name);
  return bd_fail_at(err, BD_ERR_PARAMETER, field, (double)NAN, -1, -1, value,
                    "%s must be %s%s (%s), got %.10g%s%s", field,
                    isfinite(value) ? "" : "finite and ", rules[row->rule].wording, row->text,
                    value, bare ? "" : " ", bare ? "" : row->unit);
}

static int check_length(const bd_parameter *row, const char *label, int n, int expected,
                        bd_error *err) {
  char field[64];
  snprintf(field, sizeof field, "%s.%s", label, row->name);
  if (n < 1 || n > BD_MAX_ELEMENTS) {
    return bd_fail(err, BD_ERR_PARAMETER, field, "%s must have 1 to %d numbers (%s), got %d", field,
                   BD_MAX_ELEMENTS, row->text, n);
  }
  if (n != expected) {
    return bd_fail(err, BD_ERR_PARAMETER, field,
                   "%s must have one number for each element, %d as the other lists, got %d", field,
                   expected, n);
  }
  return BD_OK;
}

int bd_parameters_check(const char *group, const char *label, const void *record, bd_error *err) {
  const int elements = bd_parameters_list_length(group, record);
  double values[BD_MAX_ELEMENTS];
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    const bd_parameter *row = &bd_parameters[k];
    if (strcmp(row->group, group) != 0) {
      continue;
    }
    const int length = list_length(row, record);
    if (row->kind == BD_IS_LIST && check_length(row, label, length, elements, err) != BD_OK) {
      return BD_ERR_PARAMETER;
    }
    const int n = bd_parameter_values(row, record, values);
    for (int e = 0; e < n; ++e) {
      if (check(row, label, values[e], err) != BD_OK) {
        return BD_ERR_PARAMETER;
      }
    }
  }
  return BD_OK;
}

int bd_check_parameter(const char *group, const char *name, const char *label, double value,
                       bd_error *err) {
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    const bd_parameter *row = &bd_parameters[k];
    if (strcmp(row->group, group) == 0 && strcmp(row->name, name) == 0) {
      return check(row, label ? label : group, value, err);
    }
  }
  return bd_fail(err, BD_ERR_PARAMETER, name, "there is no parameter %s.%s", group, name);
}
