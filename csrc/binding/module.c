/* SPDX-License-Identifier: MIT
 *
 * beltdyn._core: the module. Tables of fields.h as tuples, the closed-form Dahl functions, and the
 * one mapping from the core's errors to Python's. The contract is beltdyn/_core.pyi; guarded by
 * tests/test_module.py.
 */
#define BD_CORE_IMPORTS_NUMPY
#include "binding/binding.h"

#include <math.h>
#include <string.h>

/* --- errors ---------------------------------------------------------------------------------- */

static PyObject *message_of(int code, const bd_error *err) {
  const char *text = err->message[0] ? err->message : bd_error_text(code);
  /* "replace": a message cut off at its buffer's end may end inside a character. */
  return PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
}

static void raise_simulation_error(int code, const bd_error *err, PyObject *message) {
  PyObject *class = NULL, *arguments = NULL, *keywords = NULL, *error = NULL;
  PyObject *module = PyImport_ImportModule("beltdyn.errors");
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

/* --- functions ------------------------------------------------------------------------------- */

PyDoc_STRVAR(kernel_level_doc,
             "kernel_level()\n--\n\n"
             "Level of the compute kernels in use: \"avx512\", \"avx2\" or \"baseline\".\n\n"
             "Chosen once from the processor, or by the environment variable BELTDYN_KERNELS.");

static PyObject *kernel_level(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(none)) {
  return PyUnicode_FromString(bd_kernel_level());
}

typedef struct {
  PyArrayObject *x, *mu; /* input, and a fresh array of its shape */
  double mu0, mu_k, sigma;
} dahl_arguments;

static int positive(PyObject *object, const char *name, double *out) {
  if (bd_convert_finite(object, name, out) < 0) {
    return -1;
  }
  if (*out > 0) {
    return 0;
  }
  PyErr_Format(PyExc_ValueError, "%s must be > 0, got %R", name, object);
  return -1;
}

/* The arguments of both functions: an array called `name`, then mu0, mu_k, sigma. */
static int read_dahl(dahl_arguments *out, PyObject *args, PyObject *keywords, const char *format,
                     char *name, int ndim) {
  char *names[] = {name, "mu0", "mu_k", "sigma", NULL};
  const npy_intp any = BD_ANY;
  PyObject *x, *mu0, *mu_k, *sigma;
  *out = (dahl_arguments){0};
  if (!PyArg_ParseTupleAndKeywords(args, keywords, format, names, &x, &mu0, &mu_k, &sigma)) {
    return -1;
  }
  if (bd_convert_finite(mu0, "mu0", &out->mu0) < 0 || positive(mu_k, "mu_k", &out->mu_k) < 0 ||
      positive(sigma, "sigma", &out->sigma) < 0) {
    return -1;
  }
  out->x = bd_convert_array(x, name, ndim, &any);
  if (!out->x) {
    return -1;
  }
  out->mu =
      (PyArrayObject *)PyArray_SimpleNew(PyArray_NDIM(out->x), PyArray_DIMS(out->x), NPY_DOUBLE);
  if (!out->mu) {
    Py_CLEAR(out->x);
  }
  return out->mu ? 0 : -1;
}

PyDoc_STRVAR(check_parameter_doc,
             "check_parameter(group, name, label, value, /)\n--\n\n"
             "Check a parameter against its rule in PARAMETERS; ValueError if it breaks it.\n\n"
             "label: what the message calls the group.");

static PyObject *check_parameter(PyObject *Py_UNUSED(module), PyObject *args) {
  const char *group, *name, *label;
  PyObject *given;
  double value;
  bd_error err = {0};
  if (!PyArg_ParseTuple(args, "sssO:check_parameter", &group, &name, &label, &given) ||
      bd_convert_real(given, name, &value) < 0) {
    return NULL;
  }
  int code = bd_check_parameter(group, name, label, value, &err);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  Py_RETURN_NONE;
}

PyDoc_STRVAR(friction_law_doc,
             "friction_law(friction, link_length, z, v, normal, element=0)\n--\n\n"
             "A friction law at single links in contact, as the kernels in use evaluate it.\n\n"
             "friction: (name of a law in LAWS, tuple of its numbers). link_length: l0 [m]. z, v,\n"
             "normal: state, slip velocity [m/s] and normal force [N], shape (n,). element: of a\n"
             "law of several. Returns a dict of arrays (n,): force [N], rate of the state, and how "
             "both change: by_normal,\n"
             "by_state, by_slip, rate_by_normal, rate_by_state, rate_by_slip.");

static PyObject *friction_law(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  char *names[] = {"friction", "link_length", "z", "v", "normal", "element", NULL};
  static const char *const columns[] = {"force",         "rate",        "by_normal",
                                        "by_state",      "by_slip",     "rate_by_normal",
                                        "rate_by_state", "rate_by_slip"};
  enum { N_COLUMNS = sizeof columns / sizeof columns[0] };
  PyObject *law, *length, *objects[3], *given_element = NULL, *result = NULL;
  PyArrayObject *given[3] = {NULL, NULL, NULL};
  bd_friction friction = {0};
  double l0, *out[N_COLUMNS];
  long element = 0;
  if (!PyArg_ParseTupleAndKeywords(args, keywords, "OOOOO|O:friction_law", names, &law, &length,
                                   &objects[0], &objects[1], &objects[2], &given_element) ||
      (given_element && bd_convert_long(given_element, "element", &element) < 0) ||
      bd_core_read_friction(law, "friction", &friction) < 0 ||
      bd_convert_real(length, "link_length", &l0) < 0) {
    return NULL;
  }
  element = element < -1 || element > BD_MAX_ELEMENTS ? -1 : element; /* there is none of it */
  npy_intp n = BD_ANY;
  for (int k = 0; k < 3; k++) {
    given[k] = bd_convert_array(objects[k], names[k + 2], 1, &n);
    if (!given[k]) {
      goto done;
    }
    n = PyArray_DIM(given[k], 0);
  }
  result = PyDict_New();
  for (int c = 0; result && c < N_COLUMNS; c++) {
    PyObject *column = PyArray_SimpleNew(1, &n, NPY_DOUBLE);
    out[c] = column ? PyArray_DATA((PyArrayObject *)column) : NULL;
    if (bd_core_set(result, columns[c], column) < 0) {
      Py_CLEAR(result);
    }
  }
  for (npy_intp i = 0; result && i < n; i++) {
    const double *z = PyArray_DATA(given[0]), *v = PyArray_DATA(given[1]);
    const double *normal = PyArray_DATA(given[2]);
    bd_law_point p;
    bd_error err = {0};
    int code = bd_friction_evaluate(&friction, l0, (int)element, z[i], v[i], normal[i], &p, &err);
    if (code < 0) {
      bd_core_raise(code, &err);
      Py_CLEAR(result);
      break;
    }
    const double values[N_COLUMNS] = {p.force,   p.rate,           p.by_normal,     p.by_state,
                                      p.by_slip, p.rate_by_normal, p.rate_by_state, p.rate_by_slip};
    for (int c = 0; c < N_COLUMNS; c++) {
      out[c][i] = values[c];
    }
  }
done:
  for (int k = 0; k < 3; k++) {
    Py_XDECREF(given[k]);
  }
  return result;
}

PyDoc_STRVAR(
    friction_states_doc,
    "friction_states(friction)\n--\n\n"
    "Checks a law's numbers, and tells how many states a link has under it: 0 of a function\n"
    "of slip velocity and normal force alone. friction: as in friction_law.");

static PyObject *friction_states(PyObject *Py_UNUSED(module), PyObject *object) {
  bd_friction friction = {0};
  bd_error err = {0};
  if (bd_core_read_friction(object, "friction", &friction) < 0) {
    return NULL;
  }
  int code = bd_friction_check(&friction, bd_law_name(friction.law), &err);
  if (code < 0) {
    return bd_core_raise(code, &err);
  }
  return PyLong_FromLong(bd_friction_states(&friction));
}

PyDoc_STRVAR(
    dahl_slide_doc,
    "dahl_slide(dx, mu0, mu_k, sigma)\n--\n\n"
    "Dahl friction coefficient after sliding monotonically by dx, eq. (2.9).\n\n"
    "dx: displacements [m], any shape. mu0: coefficient before. mu_k: kinetic coefficient\n"
    "(> 0). sigma: stiffness at rest [1/m] (> 0). Returns a float64 array shaped as dx.\n"
    "Raises TypeError or ValueError naming the argument.");

static PyObject *dahl_slide(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  dahl_arguments in;
  if (read_dahl(&in, args, keywords, "OOOO:dahl_slide", "dx", BD_ANY) < 0) {
    return NULL;
  }
  const double *dx = PyArray_DATA(in.x);
  double *mu = PyArray_DATA(in.mu);
  for (npy_intp i = 0, n = PyArray_SIZE(in.x); i < n; i++) {
    mu[i] = bd_dahl_slide(dx[i], in.mu0, in.mu_k, in.sigma);
  }
  Py_DECREF(in.x);
  return (PyObject *)in.mu;
}

PyDoc_STRVAR(dahl_path_doc,
             "dahl_path(x, mu0, mu_k, sigma)\n--\n\n"
             "Dahl friction coefficient along a path with reversals anywhere, eq. (2.9).\n\n"
             "x: positions [m], shape (n,). mu0: coefficient at x[0]. mu_k: kinetic coefficient\n"
             "(> 0). sigma: stiffness at rest [1/m] (> 0). Returns the coefficient at each x,\n"
             "shape (n,). Raises TypeError or ValueError naming the argument.");

static PyObject *dahl_path(PyObject *Py_UNUSED(module), PyObject *args, PyObject *keywords) {
  dahl_arguments in;
  if (read_dahl(&in, args, keywords, "OOOO:dahl_path", "x", 1) < 0) {
    return NULL;
  }
  size_t n = (size_t)PyArray_SIZE(in.x);
  if (n) {
    bd_dahl_path(n, PyArray_DATA(in.x), in.mu0, in.mu_k, in.sigma, PyArray_DATA(in.mu));
  }
  Py_DECREF(in.x);
  return (PyObject *)in.mu;
}

PyDoc_STRVAR(
    belt_line_doc,
    "belt_line(centers, radii, outside=None, names=None)\n--\n\n"
    "The tight belt line round pulleys: for each the angle at which the belt arrives, the\n"
    "angle over which it lies, the length of the span that follows and the sense of the\n"
    "turn; the length of the line, and its turns. Raises ValueError where there is none.");

PyDoc_STRVAR(mount_directions_doc,
             "mount_directions(kind, pair, centers, /)\n--\n\n"
             "How the axis of a pulley at each of the centers (n, 2) moves with the travel of a\n"
             "mount of that kind, pivot or direction (n, 2): of an angle its lever [m], else 1.");

static PyMethodDef functions[] = {
    {"kernel_level", kernel_level, METH_NOARGS, kernel_level_doc},
    {"check_parameter", check_parameter, METH_VARARGS, check_parameter_doc},
    BD_CORE_KEYWORDS("friction_law", friction_law, friction_law_doc),
    {"friction_states", friction_states, METH_O, friction_states_doc},
    BD_CORE_KEYWORDS("belt_line", bd_core_belt_line, belt_line_doc),
    {"mount_directions", bd_core_mount_directions, METH_VARARGS, mount_directions_doc},
    BD_CORE_KEYWORDS("dahl_slide", dahl_slide, dahl_slide_doc),
    BD_CORE_KEYWORDS("dahl_path", dahl_path, dahl_path_doc),
    BD_CORE_KEYWORDS("span_tension", bd_core_span_tension, bd_core_span_tension_doc),
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

/* A tuple of n rows of `width` strings. */
static PyObject *table_of(size_t n, size_t width, const char *const *cells) {
  PyObject *table = PyTuple_New((Py_ssize_t)n);
  for (size_t i = 0; table && i < n; i++) {
    PyObject *row = PyTuple_New((Py_ssize_t)width);
    for (size_t j = 0; row && j < width; j++) {
      row = bd_core_put(row, (Py_ssize_t)j, PyUnicode_FromString(cells[i * width + j]));
    }
    table = bd_core_put(table, (Py_ssize_t)i, row);
  }
  return table;
}

#define TABLE(cells)                                                                               \
  table_of(sizeof(cells) / sizeof(cells)[0], sizeof(cells)[0] / sizeof(cells)[0][0], (cells)[0])

static PyObject *error_table(void) {
  PyObject *list = PyList_New(0);
#define X(symbol, kind, text)                                                                      \
  list = list ? bd_core_append(list, Py_BuildValue("(siss)", #symbol, symbol, #kind, text)) : NULL;
  BD_ERRORS(X)
#undef X
  return bd_core_tuple(list);
}

static PyObject *rule_table(void) {
  PyObject *list = PyList_New(0);
#define X(rule, wording, least, above, most)                                                       \
  list = list ? bd_core_append(list, Py_BuildValue("(ssdOd)", #rule, wording, (double)(least),     \
                                                   above ? Py_True : Py_False, (double)(most)))    \
              : NULL;
  BD_RULES(X)
#undef X
  return bd_core_tuple(list);
}

static PyObject *method_names(void) {
  PyObject *list = PyList_New(0);
  for (size_t k = 0; list && bd_method_name(k); k++) {
    list = bd_core_append(list, PyUnicode_FromString(bd_method_name(k)));
  }
  return bd_core_tuple(list);
}

static PyObject *names_of_fields(unsigned fields) {
  static const char *const names[] = {
#define X(symbol, name, size, scale, unit, text) #name,
      BD_STATE_FIELDS(X)
#undef X
  };
  PyObject *list = PyList_New(0);
  for (size_t f = 0; list && f < sizeof names / sizeof names[0]; f++) {
    list = fields >> f & 1u ? bd_core_append(list, PyUnicode_FromString(names[f])) : list;
  }
  return bd_core_tuple(list);
}

static PyObject *belt_table(void) {
  PyObject *list = PyList_New(0);
  for (int row = 0; list && row < BD_N_BELT_MODELS; row++) {
    const bd_belt_facts *facts = bd_belt_facts_at(row);
    PyObject *dict =
        Py_BuildValue("{s:s, s:s, s:N}", "mesh", bd_core_meshes[facts->mesh], "model",
                      bd_core_belt_models[facts->model], "fields", names_of_fields(facts->fields));
#define X(name, text)                                                                              \
  if (dict && bd_core_set(dict, #name, PyUnicode_FromString(facts->name)) < 0) {                   \
    Py_CLEAR(dict);                                                                                \
  }
    BD_BELT_TEXTS(X)
#undef X
#define X(type, name, text) BD_CORE_SET_NUMBER(dict, *facts, name)
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

static int add_tables(PyObject *module) {
  static const char *const parameters[][5] = {
#define X(group, name, rule, unit, text) {#group, #name, #rule, unit, text},
      BD_PARAMETERS(X)
#undef X
  };
  static const char *const laws[][3] = {
#define LAW(name, class, general, states, text) {#name, #class, text},
      BD_LAWS(LAW)
#undef LAW
  };
  static const char *const state_fields[][4] = {
#define X(symbol, name, size, scale, unit, text) {#name, #size, unit, text},
      BD_STATE_FIELDS(X)
#undef X
  };
  static const char *const outputs[][5] = {
#define X(name, group, size, unit, text) {#name, #group, #size, unit, text},
      BD_OUTPUTS(X)
#undef X
  };
  static const char *const energy_terms[][3] = {
#define X(name, kind, text) {#name, #kind, text},
      BD_ENERGY_TERMS(X)
#undef X
  };
  static const char *const stats[][2] = {
#define X(type, name, text) {#name, text},
      BD_STATS(X)
#undef X
  };
  return add(module, "RULES", rule_table()) < 0 ||
                 add(module, "PARAMETERS", TABLE(parameters)) < 0 ||
                 add(module, "LAWS", TABLE(laws)) < 0 ||
                 add(module, "STATE_FIELDS", TABLE(state_fields)) < 0 ||
                 add(module, "OUTPUTS", TABLE(outputs)) < 0 ||
                 add(module, "ENERGY_TERMS", TABLE(energy_terms)) < 0 ||
                 add(module, "STATS", TABLE(stats)) < 0 ||
                 add(module, "ERRORS", error_table()) < 0 ||
                 add(module, "METHODS", method_names()) < 0 ||
                 add(module, "EFFECTS", effect_table()) < 0 ||
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
  if (add_tables(module) < 0 || bd_core_add_model(module, state) < 0 ||
      bd_core_add_simulation(module, state) < 0) {
    return -1;
  }
  return 0;
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
