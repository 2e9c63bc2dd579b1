/* Launcher: the FMU's binary on Linux. It forwards every call to the component's native library if there is one
 * beside it, otherwise to PythonFMU's library, for which it provides Python.
 *
 * PythonFMU 0.7.0's own library is not linked to libpython, so only a host that is itself a Python
 * process could load it. This launcher takes its place and opens it, in its own folder, at the first
 * instantiation. It also corrects faults of the library that affect every host:
 *
 * - the resource location is decoded in full, not only "%20";
 * - an error that the component logged becomes the status of the call during which it was logged,
 *   and errors are logged even if debug logging is off, so that no host can miss them;
 * - after fmi2Fatal the instance has already been released: no further function is called on it;
 * - reset creates a new instance, because the library accesses a freed list if its own reset fails;
 * - arguments that are NULL, empty or not UTF-8 are refused instead of crashing the process;
 * - functions that are not supported are answered by one sentence, as native libraries do;
 * - a GUID of another FMU, calls out of order and steps from a wrong time are refused (calling_sequence.h).
 */
#define _GNU_SOURCE

#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>

#include "calling_sequence.h"
#include "fmi2.h"

#include "find_python.h"
#include "oldest_glibc.h"
#include "seal.h"
#include "text.h"

#define EXPORT __attribute__((visibility("default")))
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
#define PYTHONFMU "libpythonfmu-export.so"
#define NATIVE "native.so"
#define WANTED "YAWBENCH_UNITS" /* "python" for the component itself */

/* PythonFMU's library, or the native library: loaded once, at the first instantiation. */
static struct {
    void *handle;
    bool native; /* the component's native library, not PythonFMU's */
    fmi2InstantiateFn Instantiate;
    fmi2FreeInstanceFn FreeInstance;
#define MEMBER(name, parameters) fmi2##name##Fn name;
    FMI2_STATUS_FUNCTIONS(MEMBER)
#undef MEMBER
} library;
static Python python;
static pthread_mutex_t loading = PTHREAD_MUTEX_INITIALIZER;

/* State of an instance as passed to the host. */
typedef struct {
    fmi2FMUstate stock; /* the library's */
    Progress at;
} State;

typedef struct {
    fmi2Component stock; /* PythonFMU's instance */
    fmi2CallbackFunctions host;
    fmi2CallbackFunctions own;
    char *name;
    char *resources;
    char *guid;
    fmi2Boolean visible;
    bool error_logged; /* during the call in progress */
    bool dead;         /* PythonFMU's instance has been released by a fatal error */
    Progress at;
    bool log_all;
    char **categories; /* the host's choice; none means all */
    size_t n_categories;
    State **states; /* not freed yet */
    size_t n_states;
} Instance;

/* ---- log ---- */

/* Send a message of the launcher itself to the host; its text must not contain '%'. */
static void tell(const fmi2CallbackFunctions *host, const char *name, const char *text)
{
    char *safe = double_percent(text);
    if (host->logger != NULL && safe != NULL) {
        host->logger(host->componentEnvironment, name, fmi2Error, "logStatusError", safe);
    }
    free(safe);
}

/* Error messages reach every host; other messages only hosts with debug logging on. */
static bool wanted(const Instance *in, fmi2Status status, const char *category)
{
    if (status != fmi2OK && strcmp(category, "traceback") != 0) {
        return true;
    }
    if (!in->log_all || in->n_categories == 0) {
        return in->log_all;
    }
    for (size_t i = 0; i < in->n_categories; i++) {
        if (strcmp(in->categories[i], category) == 0 || strcmp(in->categories[i], "logAll") == 0) {
            return true;
        }
    }
    return false;
}

/* Logger passed to PythonFMU's library; the component has already doubled its '%'. */
static void relay(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                  fmi2String category, fmi2String message, ...)
{
    (void)name;
    Instance *in = environment;
    if (status == fmi2Error || status == fmi2Fatal) {
        in->error_logged = true;
    }
    char *safe = NULL;
    if (category == NULL) { /* from the library itself, which does not double '%' */
        category = status == fmi2Fatal ? "logStatusFatal" : status == fmi2OK ? "logAll" : "logStatusError";
        message = safe = double_percent(message);
    }
    if (in->host.logger != NULL && message != NULL && wanted(in, status, category)) {
        in->host.logger(in->host.componentEnvironment, in->name, status, category, message);
    }
    free(safe);
}

/* Return the status of a call that PythonFMU's library answered with `status`. */
static fmi2Status settled(Instance *in, fmi2Status status)
{
    in->dead = in->dead || status == fmi2Fatal;
    in->at.failed = in->at.failed || in->error_logged;
    bool hidden = in->error_logged && status < fmi2Error;
    in->error_logged = false;
    return hidden ? fmi2Error : status;
}

static inline fmi2Status checked(Instance *in, fmi2Status status)
{
    return UNLIKELY(in->error_logged || status == fmi2Fatal) ? settled(in, status) : status;
}

/* Refuse a call if it is not allowed. */
#define ALLOWED(condition)                                                                                   \
    Refusal why;                                                                                             \
    if (UNLIKELY(!(condition))) {                                                                            \
        return refused(in, why.text);                                                                        \
    }

static fmi2Status refused(Instance *in, const char *text)
{
    tell(&in->host, in->name, text);
    return fmi2Error;
}

/* Return from the calling function unless its instance `c` exists and is alive. */
#define INSTANCE(c)                                                                                          \
    Instance *in = (c);                                                                                      \
    if (UNLIKELY(in == NULL || in->dead)) {                                                                  \
        return in == NULL ? fmi2Error : fmi2Fatal;                                                           \
    }

#define REQUIRE(condition, text)                                                                             \
    if (UNLIKELY(!(condition))) {                                                                            \
        return refused(in, text);                                                                            \
    }

/* ---- loading ---- */

/* Write the folder of this library to `folder`. */
static bool own_folder(char folder[PATH_MAX])
{
    Dl_info own;
    return dladdr(&library, &own) != 0 && realpath(own.dli_fname, folder) != NULL && to_parent(folder);
}

/* Called when the process ends or the FMU is unloaded; Python itself stays loaded.
 *
 * PythonFMU's library releases its handle on Python twice when a process ends, the second time
 * through a freed pointer. If it has released the handle before, it does not release it again. This must be
 * done by an exit handler registered after the library's own, not by a destructor.
 */
static void unload(void)
{
    union {
        void *object;
        void (*call)(void);
    } symbol = {dlsym(library.handle, "finalizePythonInterpreter")};
    if (symbol.object != NULL) {
        symbol.call();
    }
    dlclose(library.handle);
    library.handle = NULL;
}

static bool open_library(const char *name, char *problem, size_t size)
{
    char folder[PATH_MAX], file[PATH_MAX + sizeof PYTHONFMU + 1];
    if (!own_folder(folder)) {
        snprintf(problem, size, "the folder of the FMU's binary cannot be found");
        return false;
    }
    snprintf(file, sizeof file, "%s/%s", folder, name);
    void *handle = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (handle == NULL) {
        snprintf(problem, size, "the library %s cannot be opened: %s", name, dlerror());
        return false;
    }
    const struct {
        const char *name;
        void *slot;
    } functions[] = {{"fmi2Instantiate", &library.Instantiate},
                     {"fmi2FreeInstance", &library.FreeInstance},
#define SLOT(name, parameters) {"fmi2" #name, &library.name},
                     FMI2_STATUS_FUNCTIONS(SLOT)
#undef SLOT
    };
    for (size_t i = 0; i < sizeof functions / sizeof *functions; i++) {
        void *symbol = dlsym(handle, functions[i].name);
        if (symbol == NULL) {
            snprintf(problem, size, "%s has no function %s", file, functions[i].name);
            dlclose(handle);
            return false;
        }
        memcpy(functions[i].slot, &symbol, sizeof symbol);
    }
    library.handle = handle;
    library.native = strcmp(name, NATIVE) == 0;
    atexit(unload);
    return true;
}

/* True if the FMU has a native library and Python is not requested. */
static bool is_native(void)
{
    char folder[PATH_MAX];
    const char *wanted = getenv(WANTED);
    return (wanted == NULL || strcmp(wanted, "python") != 0) && own_folder(folder) &&
           exists("%s/%s", folder, NATIVE);
}

static bool load(char *problem, size_t size)
{
    pthread_mutex_lock(&loading);
    bool ready =
        library.handle != NULL ||
        (is_native() ? open_library(NATIVE, problem, size)
                     : provide_python(&python, problem, size) && open_library(PYTHONFMU, problem, size));
    pthread_mutex_unlock(&loading);
    return ready;
}

/* ---- resources ---- */

/* Read the first line of a file in `folder`; false if there is none. */
static bool read_line(const char *folder, const char *name, char *line, int size)
{
    char file[PATH_MAX];
    int length = snprintf(file, sizeof file, "%s/%s", folder, name);
    FILE *text = length < (int)sizeof file ? fopen(file, "r") : NULL;
    if (text == NULL) {
        return false;
    }
    bool read = fgets(line, size, text) != NULL;
    fclose(text);
    return read;
}

/* True if `folder` contains the files that PythonFMU's library reads without checking. */
static bool is_complete(const char *folder)
{
    char module[256] = "";
    bool named = read_line(folder, "slavemodule.txt", module, sizeof module);
    module[strcspn(module, "\r\n")] = '\0';
    return named && exists("%s/%s.py", folder, module);
}

/* True if `guid` is that packed with the resources. */
static bool is_guid_of(const char *folder, const char *guid)
{
    char packed[64] = "";
    return read_line(folder, "guid.txt", packed, sizeof packed) && strcmp(packed, guid) == 0;
}

/* Return the resource folder in the form expected by PythonFMU's library; NULL with a sentence in `problem`. */
static char *find_resources(const char *location, const char *guid, char *problem, size_t size)
{
    char folder[PATH_MAX], own[PATH_MAX + sizeof "/../../resources"];
    char *decoded = strdup(location == NULL ? "" : without_scheme(location));
    char *plain = decoded == NULL ? NULL : strdup(decoded);
    if (plain == NULL) {
        free(decoded);
        snprintf(problem, size, "out of memory");
        return NULL;
    }
    decode_percent(decoded);
    own[0] = '\0';
    if (own_folder(
            folder)) { /* from the standard's layout, if the host passes no location or a wrong one */
        snprintf(own, sizeof own, "%s/../../resources", folder);
    }
    const char *candidates[] = {decoded, plain, own};
    for (size_t i = 0; i < sizeof candidates / sizeof *candidates; i++) {
        if (candidates[i][0] != '\0' && realpath(candidates[i], folder) != NULL && is_complete(folder)) {
            char *found = spelled_for_pythonfmu(folder);
            if (found == NULL || !is_utf8(folder)) {
                snprintf(problem, size, "the FMU lies in a folder that PythonFMU cannot read: %s", folder);
            } else if (!is_guid_of(folder, guid)) {
                snprintf(problem, size,
                         "the GUID is not that of this FMU: the model description is of another build");
            } else {
                free(decoded);
                free(plain);
                return found;
            }
            free(found);
            free(decoded);
            free(plain);
            return NULL;
        }
    }
    snprintf(problem, size, "the FMU's resources are incomplete or not at %s",
             location == NULL ? "(none)" : location);
    free(decoded);
    free(plain);
    return NULL;
}

/* ---- FMI: life cycle ---- */

EXPORT fmi2String fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT fmi2String fmi2GetVersion(void)
{
    return "2.0";
}

static void choose_categories(Instance *in, size_t count, const fmi2String categories[])
{
    for (size_t i = 0; i < in->n_categories; i++) {
        free(in->categories[i]);
    }
    free(in->categories);
    in->n_categories = 0;
    in->categories = count > 0 && categories != NULL ? calloc(count, sizeof *in->categories) : NULL;
    for (size_t i = 0; in->categories != NULL && i < count; i++) {
        char *copy = categories[i] == NULL ? NULL : strdup(categories[i]);
        if (copy != NULL) {
            in->categories[in->n_categories++] = copy;
        }
    }
}

static void discard(Instance *in)
{
    choose_categories(in, 0, NULL);
    for (size_t i = 0; i < in->n_states; i++) {
        free(in->states[i]);
    }
    free(in->states);
    free(in->name);
    free(in->resources);
    free(in->guid);
    free(in);
}

/* PythonFMU's library always logs, so that no error is lost; `wanted` decides what the host gets. */
static fmi2Component new_stock(Instance *in)
{
    return library.Instantiate(in->name, fmi2CoSimulation, in->guid, in->resources, &in->own, in->visible,
                               fmi2True);
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                     fmi2Boolean logging_on)
{
    char problem[2 * PATH_MAX];
    if (functions == NULL) {
        return NULL;
    }
    if (name == NULL || *name == '\0' || !is_utf8(name)) {
        tell(functions, "", "fmi2Instantiate needs an instance name in UTF-8");
        return NULL;
    }
    if (type != fmi2CoSimulation) {
        tell(functions, name, "this FMU is for co-simulation only");
        return NULL;
    }
    if (!load(problem, sizeof problem)) {
        tell(functions, name, problem);
        return NULL;
    }
    Instance *in = calloc(1, sizeof *in);
    if (in == NULL) {
        return NULL;
    }
    in->host = *functions;
    in->own = (fmi2CallbackFunctions){relay, functions->allocateMemory, functions->freeMemory, NULL, in};
    in->name = strdup(name);
    in->visible = visible;
    in->log_all = logging_on != fmi2False;
    in->guid = strdup(guid == NULL ? "" : guid);
    if (!library.native && in->guid != NULL) { /* not needed by a native library */
        in->resources = find_resources(location, in->guid, problem, sizeof problem);
    }
    if (in->resources == NULL && !library.native) {
        tell(functions, name, problem);
    } else if (in->name != NULL && in->guid != NULL) {
        in->stock = new_stock(in);
        in->error_logged = false;
    }
    if (in->stock == NULL) {
        discard(in);
        return NULL;
    }
    return in;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    Instance *in = c;
    if (in == NULL) {
        return;
    }
    for (size_t i = 0; i < in->n_states; i++) {
        library.FreeFMUstate(in->stock, &in->states[i]->stock);
    }
    if (!in->dead) {
        library.FreeInstance(in->stock);
    }
    discard(in);
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean logging_on, size_t count,
                                      const fmi2String categories[])
{
    INSTANCE(c)
    REQUIRE(count == 0 || categories != NULL, "fmi2SetDebugLogging: no categories given")
    in->log_all = logging_on != fmi2False;
    choose_categories(in, count, categories);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                      fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    INSTANCE(c)
    ALLOWED(set_up(&in->at, "fmi2SetupExperiment", start, stop_defined, stop, &why))
    return checked(
        in, library.SetupExperiment(in->stock, tolerance_defined, tolerance, start, stop_defined, stop));
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    INSTANCE(c)
    ALLOWED(pass_on(&in->at, BEFORE_INITIALIZATION, DURING_INITIALIZATION, "fmi2EnterInitializationMode", &why))
    return checked(in, library.EnterInitializationMode(in->stock));
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    INSTANCE(c)
    ALLOWED(pass_on(&in->at, DURING_INITIALIZATION, AFTER_INITIALIZATION, "fmi2ExitInitializationMode", &why))
    return checked(in, library.ExitInitializationMode(in->stock));
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    INSTANCE(c)
    ALLOWED(terminate(&in->at, "fmi2Terminate", &why))
    return checked(in, library.Terminate(in->stock));
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    INSTANCE(c)
    fmi2Component fresh = new_stock(in);
    in->error_logged = false;
    if (fresh == NULL) {
        return fmi2Error;
    }
    library.FreeInstance(in->stock);
    in->stock = fresh;
    in->at = (Progress){.phase = BEFORE_INITIALIZATION};
    return checked(in, fmi2OK);
}

/* ---- FMI: values ---- */

#define ACCESS(Verb, Type, constant, check)                                                                  \
    EXPORT fmi2Status fmi2##Verb##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n,             \
                                       constant fmi2##Type value[])                                          \
    {                                                                                                        \
        INSTANCE(c)                                                                                          \
        if (UNLIKELY(n == 0)) {                                                                              \
            return fmi2OK;                                                                                   \
        }                                                                                                    \
        REQUIRE(vr != NULL && value != NULL, "fmi2" #Verb #Type ": value references or values are missing")  \
        check return checked(in, library.Verb##Type(in->stock, vr, n, value));                               \
    }

static bool all_utf8(size_t n, const fmi2String value[])
{
    for (size_t i = 0; i < n; i++) {
        if (value[i] == NULL || !is_utf8(value[i])) {
            return false;
        }
    }
    return true;
}

ACCESS(Get, Real, , )
ACCESS(Get, Integer, , )
ACCESS(Get, Boolean, , )
ACCESS(Get, String, , )
ACCESS(Set, Real, const, )
ACCESS(Set, Integer, const, )
ACCESS(Set, Boolean, const, )
ACCESS(Set, String, const, REQUIRE(all_utf8(n, value), "fmi2SetString: a string is missing or not UTF-8"))

/* ---- FMI: state ---- */

/* Register a new state, so that it is freed with its instance; false if out of memory. */
static bool keep(Instance *in, State *state)
{
    State **states = realloc(in->states, (in->n_states + 1) * sizeof *states);
    if (states != NULL) {
        in->states = states;
        states[in->n_states++] = state;
    }
    return states != NULL;
}

static bool forget(Instance *in, const State *state)
{
    for (size_t i = 0; i < in->n_states; i++) {
        if (in->states[i] == state) {
            in->states[i] = in->states[--in->n_states];
            return true;
        }
    }
    return false;
}

static fmi2Status release(Instance *in, State *state)
{
    fmi2Status status = library.FreeFMUstate(in->stock, &state->stock);
    free(state);
    return status;
}

static bool is_empty(fmi2FMUstate state)
{
    if (library.native) {
        return state == NULL;
    }
    int lock = python.PyGILState_Ensure();
    bool empty = python.PyDict_Size(state) <= 0;
    python.PyGILState_Release(lock);
    return empty;
}

/* Return a new state in `*target`, replacing an existing state; a failed instance gives an empty state. */
static fmi2Status deliver(Instance *in, fmi2FMUstate fresh, Progress at, fmi2FMUstate *target,
                          const char *failure)
{
    State *state = is_empty(fresh) ? NULL : malloc(sizeof *state);
    if (state == NULL || !keep(in, state)) {
        free(state);
        library.FreeFMUstate(in->stock, &fresh);
        return refused(in, failure);
    }
    *state = (State){fresh, at};
    if (*target != NULL && forget(in, *target)) {
        release(in, *target);
    }
    *target = state;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    INSTANCE(c)
    REQUIRE(state != NULL, "fmi2GetFMUstate: no place for the state")
    fmi2FMUstate fresh = NULL;
    fmi2Status status = checked(in, library.GetFMUstate(in->stock, &fresh));
    if (status == fmi2Error && fresh != NULL) {
        library.FreeFMUstate(in->stock, &fresh);
    }
    return status != fmi2OK ? status
                            : deliver(in, fresh, in->at, state, "fmi2GetFMUstate: the state is empty");
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    INSTANCE(c)
    REQUIRE(state != NULL, "fmi2SetFMUstate: no state given")
    const State *saved = state;
    in->at = saved->at;
    return checked(in, library.SetFMUstate(in->stock, saved->stock));
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    Instance *in = c;
    if (in == NULL) {
        return fmi2Error;
    }
    if (state == NULL || *state == NULL) {
        return fmi2OK;
    }
    REQUIRE(forget(in, *state), "fmi2FreeFMUstate: not a state of this instance, or freed before")
    fmi2Status status = release(in, *state);
    *state = NULL;
    return status;
}

/* Serialized state: the library's serialization, phase and time of the instance, seal. */
EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    INSTANCE(c)
    REQUIRE(state != NULL && size != NULL, "fmi2SerializedFMUstateSize: no state, or no place for its size")
    fmi2Status status = checked(in, library.SerializedFMUstateSize(in->stock, ((State *)state)->stock, size));
    REQUIRE(status != fmi2OK || *size > 0, "fmi2SerializedFMUstateSize: this state cannot be serialized")
    *size += sizeof(Progress) + sizeof(Seal);
    return status;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    INSTANCE(c)
    REQUIRE(bytes != NULL, "fmi2SerializeFMUstate: no place for the bytes")
    size_t needed = 0; /* the library copies as many bytes as requested, without checking */
    fmi2Status status = fmi2SerializedFMUstateSize(c, state, &needed);
    if (status != fmi2OK) {
        return status;
    }
    REQUIRE(size >= needed, "fmi2SerializeFMUstate: the place for the bytes is too small")
    const State *saved = state;
    needed -= sizeof saved->at + sizeof(Seal);
    status = checked(in, library.SerializeFMUstate(in->stock, saved->stock, bytes, needed));
    memcpy(bytes + needed, &saved->at, sizeof saved->at);
    seal(in->guid, bytes, needed + sizeof saved->at);
    return status;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                          fmi2FMUstate *state)
{
    static const char failure[] = "fmi2DeSerializeFMUstate: not a state of this FMU";
    INSTANCE(c)
    REQUIRE(bytes != NULL && state != NULL, "fmi2DeSerializeFMUstate: no bytes, or no place for the state")
    Progress at;
    REQUIRE(size > sizeof at + sizeof(Seal) && is_sealed(in->guid, bytes, size), failure)
    size -= sizeof at + sizeof(Seal);
    memcpy(&at, bytes + size, sizeof at);
    fmi2FMUstate fresh = NULL;
    fmi2Status status = checked(in, library.DeSerializeFMUstate(in->stock, bytes, size, &fresh));
    return status != fmi2OK ? status : deliver(in, fresh, at, state, failure);
}

/* ---- FMI: step ---- */

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set_state_prior)
{
    INSTANCE(c)
    ALLOWED(in->at.failed || may_step(&in->at, "fmi2DoStep", t, h, &why))
    fmi2Status status = checked(in, library.DoStep(in->stock, t, h, no_set_state_prior));
    if (status <= fmi2Warning) {
        in->at.time = t + h;
    }
    return UNLIKELY(status == fmi2Discard && in->at.failed) ? fmi2Error : status;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    INSTANCE(c)
    REQUIRE(value != NULL, "fmi2GetRealStatus: no place for the value")
    REQUIRE(kind == fmi2LastSuccessfulTime, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone")
    *value = in->at.time;
    return fmi2OK;
}

#define UNSUPPORTED(name, parameters, ...)                                                                   \
    EXPORT fmi2Status fmi2##name parameters                                                                  \
    {                                                                                                        \
        __VA_ARGS__;                                                                                         \
        INSTANCE(c)                                                                                          \
        return refused(in, "fmi2" #name " is not supported");                                                \
    }
FMI2_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
