/* SPDX-License-Identifier: MIT
 *
 * beltdyn._core: the module. Tables of fields.h as tuples, and the one mapping from the core's
 * errors to Python's. The contract is beltdyn/_core.pyi; guarded by tests/test_module.py.
 */
#define BD_CORE_IMPORTS_NUMPY
#include "binding/binding.h"

#include <stddef.h>
#include <string.h>

/* --- errors ---------------------------------------------------------------------------------- */

static PyObject *message_of(int code, const bd_error *err) {
  const char *text = err->message[0] ? err->message : bd_error_text(code);
  /* "replace": a message cut off at its buffer's end may end inside a character. */
  return PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
}

static void raise_simulation_error(int code, const bd_error *err, PyObject *message) {
  PyObject *class = NULL, *arguments = NULL, *keywords = NULL, *error = NULL;
  PyObject *module = PyImport_ImportModule("beltdyn.result.errors");
  if (!module) {
    goto out;
  }
  class = PyObject_GetAttrString(module, "SimulationError");
  arguments = PyTuple_Pack(1, message);
  keywords = Py_BuildValue("{s:s, s:d, s:i, s:i, s:d, s:s}", "symbol", bd_error_symbol(code), "t",
                           err->t, "body", err->body, "pulley", err->pulley, "value", err->value,
                           "field", err->field);
  if (!class || !arguments || !keywords) {
    goto out;
  }
  error = PyObject_Call(class, arguments, keywords);
  if (error) {
    PyErr_SetObject((PyObject *)Py_TYPE(error), error);
  }
out:
  Py_XDECREF(module);
  Py_XDECREF(class);
  Py_XDECREF(arguments);
  Py_XDECREF(keywords);
  Py_XDECREF(error);
}

PyObject *bd_core_raise(int code, const bd_error *err) {
  int kind = bd_error_kind(code);
  if (kind == BD_KIND_CALL) {
    /* The callback's own exception goes on unchanged. It is gone when the run is asked again. */
    if (!PyErr_Occurred()) {
      PyErr_SetString(PyExc_RuntimeError,
                      "the run was ended by an exception in its torque function");
    }
    return NULL;
  }
  if (kind == BD_KIND_MEMORY) {
    PyErr_SetString(PyExc_MemoryError, err->message);
    return NULL;
  }
  PyObject *message = message_of(code, err);
  if (!message) {
    return NULL;
  }
  if (kind == BD_KIND_RUN) {
    raise_simulation_error(code, err, message);
  } else {
    PyErr_SetObject(kind == BD_KIND_VALUE ? PyExc_ValueError : PyExc_RuntimeError, message);
  }
  Py_DECREF(message);
  return NULL;
}

PyObject *bd_core_result(PyObject *result, int code, const bd_error *err) {
  if (code < 0) {
    Py_XDECREF(result);
    return bd_core_raise(code, err);
  }
  return result;
}

/* --- functions ------------------------------------------------------------------------------- */

static PyObject *kernel_level(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(none)) {
  return PyUnicode_FromString(bd_kernel_level());
}

static PyObject *check_parameter(PyObject *Py_UNUSED(module), PyObject *args) {
  const char *group, *name, *label;
  PyObject *given;
  double value;
  bd_error err = {0};
  if (!PyArg_ParseTuple(args, "sssO:check_parameter", &group, &name, &label, &given) ||
      bd_convert_real(given, name, &value) < 0) {
    return NULL;
  }
  const int code = bd_check_parameter(group, name, label, value, &err);
  return bd_core_result(Py_NewRef(Py_None), code, &err);
}

static PyObject *friction_law(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  static const struct {
    const char *name;
    size_t member;
  } columns[] = {
#define COLUMN(name) {#name, offsetof(bd_law_point, name)}
      COLUMN(force),   COLUMN(rate),           COLUMN(by_normal),     COLUMN(by_state),
      COLUMN(by_slip), COLUMN(rate_by_normal), COLUMN(rate_by_state), COLUMN(rate_by_slip),
#undef COLUMN
  };
  enum { N_COLUMNS = sizeof columns / sizeof columns[0] };
  PyObject *law, *objects[3], *result = NULL;
  PyArrayObject *given[3] = {NULL, NULL, NULL};
  bd_friction friction = {0};
  double l0, *out[N_COLUMNS];
  long element = 0;
  const bd_argument rows[] = {{"friction", BD_OBJECT, &law},
                              {"link_length", BD_REAL, &l0},
                              {"z", BD_OBJECT, &objects[0]},
                              {"v", BD_OBJECT, &objects[1]},
                              {"normal", BD_OBJECT, &objects[2]},
                              {"element", BD_LONG, &element},
                              {0}};
  if (bd_convert_arguments(args, keywords, "friction_law", 5, 6, rows) < 0 ||
      bd_core_read_friction(law, "friction", &friction) < 0) {
    return NULL;
  }
  element = element < -1 || element > BD_MAX_ELEMENTS ? -1 : element; /* there is none of it */
  npy_intp n = BD_ANY;
  for (int k = 0; k < 3; k++) {
    given[k] = bd_convert_array(objects[k], rows[k + 2].name, 1, &n);
    if (!given[k]) {
      goto done;
    }
    n = PyArray_DIM(given[k], 0);
  }
  result = PyDict_New();
  for (int c = 0; result && c < N_COLUMNS; c++) {
    PyObject *column = PyArray_SimpleNew(1, &n, NPY_DOUBLE);
    out[c] = column ? PyArray_DATA((PyArrayObject *)column) : NULL;
    if (bd_core_set(result, columns[c].name, column) < 0) {
      Py_CLEAR(result);
    }
  }
  for (npy_intp i = 0; result && i < n; i++) {
    const double *z = PyArray_DATA(given[0]), *v = PyArray_DATA(given[1]);
    const double *normal = PyArray_DATA(given[2]);
    bd_law_point p;
    bd_error err = {0};
    const int code =
        bd_friction_evaluate(&friction, l0, (int)element, z[i], v[i], normal[i], &p, &err);
    result = bd_core_result(result, code, &err);
    for (int c = 0; result && c < N_COLUMNS; c++) {
      memcpy(&out[c][i], (const char *)&p + columns[c].member, sizeof(double));
    }
  }
done:
  for (int k = 0; k < 3; k++) {
    Py_XDECREF(given[k]);
  }
  return result;
}

static PyObject *friction_states(PyObject *Py_UNUSED(module), PyObject *object) {
  bd_friction friction = {0};
  bd_error err = {0};
  if (bd_core_read_friction(object, "friction", &friction) < 0) {
    return NULL;
  }
  const int code = bd_friction_check(&friction, bd_law_name(friction.law), &err);
  return code < 0 ? bd_core_raise(code, &err) : PyLong_FromLong(bd_friction_states(&friction));
}

static PyMethodDef functions[] = {
    {"kernel_level", kernel_level, METH_NOARGS,
     "kernel_level()\n--\n\n"
     "Level of the compute kernels in use: \"avx512\", \"avx2\" or \"baseline\"."},
    {"check_parameter", check_parameter, METH_VARARGS,
     "check_parameter(group, name, label, value, /)\n--\n\n"
     "Check a parameter against its rule in PARAMETERS."},
    BD_CORE_KEYWORDS(
        "friction_law", friction_law,
        "friction_law(friction, link_length, z, v, normal, element=0)\n--\n\n"
        "A friction law at single links in contact, as the kernels in use evaluate it."),
    {"friction_states", friction_states, METH_O,
     "friction_states(friction)\n--\n\n"
     "How many states a link has under a law, whose numbers are checked."},
    BD_CORE_KEYWORDS("belt_line", bd_core_belt_line,
                     "belt_line(centers, radii, outside=None, names=None)\n--\n\n"
                     "The tight belt line round pulleys: of each a bd_wrap; length, turns."),
    {"mount_directions", bd_core_mount_directions, METH_VARARGS,
     "mount_directions(kind, pair, centers, /)\n--\n\n"
     "How axes at these centers move with the travel of a mount of that kind."},
    BD_CORE_KEYWORDS("span_tension", bd_core_span_tension,
                     "span_tension(pulley, force, n_pulleys)\n--\n\n"
                     "Mean force of the joints of the free span that follows each pulley."),
    {NULL, NULL, 0, NULL},
};

/* --- tables ---------------------------------------------------------------------------------- */

static int add(PyObject *module, const char *name, PyObject *value) {
  if (!value) {
    return -1;
  }
  int failed = PyModule_AddObjectRef(module, name, value);
  Py_DECREF(value);
  return failed;
}

static PyObject *method_names(void) {
  PyObject *list = PyList_New(0);
  for (size_t k = 0; list && bd_method_name(k); k++) {
    list = bd_core_append(list, PyUnicode_FromString(bd_method_name(k)));
  }
  return bd_core_tuple(list);
}

static const char *field_name(int row) {
  static const char *const names[] = {
#define X(symbol, name, size, scale, unit, text) #name,
      BD_STATE_FIELDS(X)
#undef X
  };
  return row < (int)(sizeof names / sizeof names[0]) ? names[row] : NULL;
}

/* Of the rows of a table whose bits are set. */
static PyObject *names_of(unsigned bits, const char *(*name)(int row)) {
  PyObject *list = PyList_New(0);
  for (int row = 0; list && name(row); row++) {
    list = bits >> row & 1u ? bd_core_append(list, PyUnicode_FromString(name(row))) : list;
  }
  return bd_core_tuple(list);
}

static PyObject *belt_table(void) {
  PyObject *list = PyList_New(0);
  for (int row = 0; list && row < BD_N_BELT_MODELS; row++) {
    const bd_belt_facts *facts = bd_belt_facts_at(row);
    PyObject *dict = Py_BuildValue("{s:s, s:s, s:N, s:N}", "mesh", bd_core_meshes[facts->mesh],
                                   "model", bd_core_belt_models[facts->model], "fields",
                                   names_of(facts->fields, field_name), "lacks",
                                   names_of(facts->lacks, bd_size_name));
#define X(name, text) BD_CORE_SET_VALUE(dict, *facts, name)
    BD_BELT_TEXTS(X)
#undef X
#define X(type, name, text) BD_CORE_SET_VALUE(dict, *facts, name)
    BD_BELT_FACTS(X)
#undef X
    list = bd_core_append(list, dict);
  }
  return bd_core_tuple(list);
}

static PyObject *effect_table(void) {
  PyObject *list = PyList_New(0);
  for (int k = 0; list && bd_effect_name(k); k++) {
    list = bd_core_append(list, Py_BuildValue("(ss)", bd_effect_name(k), bd_effect_asked_by(k)));
  }
  return bd_core_tuple(list);
}

/* Adds a table of fields.h, whose rows X appends to the list. */
#define ADD_TABLE(name, ROWS)                                                                      \
  list = PyList_New(0);                                                                            \
  ROWS(X)                                                                                          \
  if (add(module, name, bd_core_tuple(list)) < 0) {                                                \
    return -1;                                                                                     \
  }

#define ROW(...) list = bd_core_append(list, Py_BuildValue(__VA_ARGS__));

static int add_tables(PyObject *module) {
  PyObject *list;
#define X(rule, wording, least, above, most)                                                       \
  ROW("(ssdOd)", #rule, wording, (double)(least), above ? Py_True : Py_False, (double)(most))
  ADD_TABLE("RULES", BD_RULES)
#undef X
#define X(group, name, rule, unit, text) ROW("(sssss)", #group, #name, #rule, unit, text)
  ADD_TABLE("PARAMETERS", BD_PARAMETERS)
#undef X
#define X(name, class, general, states, text) ROW("(sss)", #name, #class, text)
  ADD_TABLE("LAWS", BD_LAWS)
#undef X
#define X(symbol, name, size, scale, unit, text) ROW("(ssss)", #name, #size, unit, text)
  ADD_TABLE("STATE_FIELDS", BD_STATE_FIELDS)
#undef X
#define X(name, group, size, unit, text) ROW("(sssss)", #name, #group, #size, unit, text)
  ADD_TABLE("OUTPUTS", BD_OUTPUTS)
#undef X
#define X(name, kind, text) ROW("(sss)", #name, #kind, text)
  ADD_TABLE("ENERGY_TERMS", BD_ENERGY_TERMS)
#undef X
#define X(type, name, text) ROW("(ss)", #name, text)
  ADD_TABLE("STATS", BD_STATS)
#undef X
#define X(symbol, kind, text) ROW("(siss)", #symbol, symbol, #kind, text)
  ADD_TABLE("ERRORS", BD_ERRORS)
#undef X
  return add(module, "METHODS", method_names()) < 0 || add(module, "EFFECTS", effect_table()) < 0 ||
                 add(module, "BELTS", belt_table()) < 0 ||
                 add(module, "MAX_STRAIN", PyFloat_FromDouble(BD_MAX_STRAIN)) < 0 ||
                 add(module, "GRAVITY", PyFloat_FromDouble(BD_GRAVITY)) < 0 ||
                 add(module, "MAX_LINKS", PyLong_FromLong(BD_MAX_LINKS)) < 0 ||
                 add(module, "__version__", PyUnicode_FromString(BD_VERSION)) < 0
             ? -1
             : 0;
}

/* --- module ---------------------------------------------------------------------------------- */

static int module_exec(PyObject *module) {
  /* What the slot below says to Python 3.12 and later. */
  if (PyInterpreterState_Get() != PyInterpreterState_Main()) {
    PyErr_SetString(PyExc_ImportError,
                    "beltdyn._core cannot be loaded in a sub-interpreter: NumPy, which it uses, is "
                    "one per process. Use the main interpreter, its threads, or processes");
    return -1;
  }
  import_array1(-1);
  bd_core_module *state = PyModule_GetState(module);
  return add_tables(module) < 0 || bd_core_add_model(module, state) < 0 ||
                 bd_core_add_simulation(module, state) < 0
             ? -1
             : 0;
}

static int module_traverse(PyObject *module, visitproc visit, void *arg) {
  bd_core_module *state = PyModule_GetState(module);
  Py_VISIT(state->model_type);
  Py_VISIT(state->simulation_type);
  return 0;
}

static int module_clear(PyObject *module) {
  bd_core_module *state = PyModule_GetState(module);
  Py_CLEAR(state->model_type);
  Py_CLEAR(state->simulation_type);
  return 0;
}

static void module_free(void *module) {
  module_clear(module);
}

/* NumPy's function table is one per process, so one interpreter only. The busy flag of a
 * simulation is atomic, but states, sampled arrays and argument checks rely on the GIL. */
static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, module_exec},
#ifdef Py_mod_multiple_interpreters
    {Py_mod_multiple_interpreters, Py_MOD_MULTIPLE_INTERPRETERS_NOT_SUPPORTED},
#endif
#ifdef Py_mod_gil
    {Py_mod_gil, Py_MOD_GIL_USED},
#endif
    {0, NULL},
};

PyDoc_STRVAR(module_doc,
             "The C core of beltdyn as Python sees it: positional arguments, strict checks.\n\n"
             "Use beltdyn instead. SI units, angles in rad.");

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT,         .m_name = "beltdyn._core",
    .m_doc = module_doc,           .m_size = sizeof(bd_core_module),
    .m_methods = functions,        .m_slots = module_slots,
    .m_traverse = module_traverse, .m_clear = module_clear,
    .m_free = module_free,
};

PyMODINIT_FUNC PyInit__core(void);
PyMODINIT_FUNC PyInit__core(void) {
  return PyModuleDef_Init(&module_definition);
}
