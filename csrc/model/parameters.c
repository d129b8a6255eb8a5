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
   _Generic(((bd_##group *)0)->name, int : 1, double : 0),                                         \
   offsetof(bd_##group, name)},
    BD_PARAMETERS(X)
#undef X
};

enum { N_PARAMETERS = sizeof bd_parameters / sizeof bd_parameters[0] };
const size_t bd_n_parameters = N_PARAMETERS;

double bd_parameter_value(const bd_parameter *row, const void *group) {
  const char *field = (const char *)group + row->offset;
  int count;
  double number;
  if (row->is_integer) {
    memcpy(&count, field, sizeof count);
    return count;
  }
  memcpy(&number, field, sizeof number);
  return number;
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

int bd_parameters_check(const char *group, const char *label, const void *record, bd_error *err) {
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    const bd_parameter *row = &bd_parameters[k];
    if (strcmp(row->group, group) == 0 &&
        check(row, label, bd_parameter_value(row, record), err) != BD_OK) {
      return BD_ERR_PARAMETER;
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
