/* FMI 2.0 for co-simulation, for components translated to C.
 *
 * The generated file of a component includes arithmetic.h, defines Variables, DECLARED, Configured, State and
 *
 *     configure(problem, v, c)                      derives values from the parameters
 *     start(problem, v, c, s, lists, t)             sets the state at start time
 *     advance(problem, v, c, s, lists, t, h)        advances the state from t to t + h
 *     output(problem, v, c, s, lists, y, t)         computes all outputs at t
 *
 * which return 0, or 1 with the exception that the component would have raised in `problem`, and includes this
 * file last. Order of calls and messages are those of components/fmi/component.py. There are no global variables,
 * so instances may run in any number of threads. */
#include "calling_sequence.h"
#include "fmi2.h"
#include "seal.h"

#if defined _WIN32
#define FMI2_EXPORT __declspec(dllexport)
#else
#define FMI2_EXPORT __attribute__((visibility("default")))
#endif

enum { LONGEST_TEXT = 256 }; /* length of a text that is not among a parameter's choices */

/* Everything that is saved and restored with the state of an instance. */
typedef struct {
    Variables v;
    Configured c;
    State s;
    double y[N_OUTPUTS > 0 ? N_OUTPUTS : 1];
    double start_time;
    int initializing; /* until initialization ends, outputs follow the inputs */
    int stale;        /* a variable has been set since the outputs were computed */
    int configured;   /* since the last change of a parameter */
    Progress at;
    char wrong[N_VARIABLES > N_REALS ? N_VARIABLES - N_REALS : 1][LONGEST_TEXT]; /* texts, if not choices */
} Content;

typedef struct {
    Content content;
    List lists[N_LISTS > 0 ? N_LISTS : 1];
} Saved;

typedef struct {
    fmi2CallbackFunctions host;
    char *name;
    Saved now;
} Instance;

/* ---- log ---- */

static void send(const Instance *instance, fmi2Status status, const char *category, const char *text)
{
    char *safe = malloc(2 * strlen(text) + 1), *end = safe;
    if (safe == NULL || instance->host.logger == NULL) {
        free(safe);
        return;
    }
    for (const char *c = text; *c != '\0'; c++) { /* a host may print it with printf */
        *end++ = *c;
        if (*c == '%') {
            *end++ = '%';
        }
    }
    *end = '\0';
    instance->host.logger(instance->host.componentEnvironment, instance->name, status, category, safe);
    free(safe);
}

static fmi2Status complain(const Instance *instance, const char *text)
{
    send(instance, fmi2Error, "logStatusError", text);
    return fmi2Error;
}

static double *real_at(Instance *instance, size_t i)
{
    return (double *)((char *)&instance->now.content.v + DECLARED[i].place);
}

static int *other_at(Instance *instance, size_t i)
{
    return (int *)((char *)&instance->now.content.v + DECLARED[i].place);
}

static fmi2Status refuse(const Instance *instance, const Refusal *why)
{
    return complain(instance, why->text);
}

/* Log an exception as the component would, and mark the instance as failed. */
static fmi2Status fail(Instance *instance, const char *what, double t, const Problem *problem)
{
    static const Problem empty;
    Problem *sentence = malloc(sizeof *sentence);
    char number[64];
    instance->now.content.at.failed = 1;
    if (sentence == NULL) {
        return complain(instance, what);
    }
    *sentence = empty;
    say(sentence, what);
    say(sentence, " at t = ");
    say_real(sentence, t, 9);
    say(sentence, " s: ");
    say(sentence, problem->kind);
    say(sentence, ": ");
    say(sentence, problem->text);
    say(sentence, problem->where);
    for (size_t i = 0; i < (size_t)N_INPUTS; i++) {
        say(sentence, i == 0 ? "; inputs: " : ", ");
        say(sentence, DECLARED[i].name);
        say(sentence, " = ");
        write_repr(number, *real_at(instance, i));
        if (sizeof sentence->text - sentence->length < sizeof number + 64) { /* truncated, unlike in Python */
            say(sentence, "...");
            break;
        }
        say(sentence, number);
    }
    complain(instance, sentence->text);
    free(sentence);
    return fmi2Error;
}

/* "reading Real [3, 4] failed", in memory that the caller frees. */
static char *naming(const char *doing, const char *type, const fmi2ValueReference r[], size_t n)
{
    char *text = malloc(64 + 12 * n), *end = text;
    if (text != NULL) {
        end += sprintf(end, "%s %s [", doing, type);
        for (size_t i = 0; i < n; i++) {
            end += sprintf(end, i == 0 ? "%u" : ", %u", r[i]);
        }
        strcpy(end, "] failed");
    }
    return text;
}

static fmi2Status fail_at(Instance *instance, const char *doing, const char *type,
                          const fmi2ValueReference r[], size_t n, const Problem *problem)
{
    char *text = naming(doing, type, r, n);
    fmi2Status status = fail(instance, text == NULL ? doing : text, instance->now.content.start_time, problem);
    free(text);
    return status;
}

static void say_name(Problem *problem, fmi2ValueReference r)
{
    char text[32];
    snprintf(text, sizeof text, "value reference %u", r);
    say(problem, r < N_VARIABLES ? DECLARED[r].name : text);
}

/* ---- functions of the component ---- */

static void say_quoted(Problem *problem, const char *text)
{
    const char *quote = strchr(text, '\'') != NULL && strchr(text, '"') == NULL ? "\"" : "'";
    say(problem, quote);
    for (; *text != '\0'; text++) {
        unsigned char c = (unsigned char)*text;
        char one[8] = {*text, '\0'};
        if (c == '\\' || c == (unsigned char)*quote) {
            snprintf(one, sizeof one, "\\%c", c);
        } else if (c == '\n' || c == '\r' || c == '\t') {
            snprintf(one, sizeof one, "\\%c", c == '\n' ? 'n' : c == '\r' ? 'r' : 't');
        } else if (c < 32 || c == 127) {
            snprintf(one, sizeof one, "\\x%02x", c);
        }
        say(problem, one);
    }
    say(problem, quote);
}

/* Check a parameter; 1 with the problem if its value is not allowed. */
static int wrong_parameter(Instance *instance, size_t i, Problem *problem)
{
    const Declared *d = &DECLARED[i];
    if (d->type == STRING && *other_at(instance, i) < 0) {
        begin_problem(problem, "ValueError", "");
        say(problem, d->name);
        say(problem, " must be one of ");
        for (int k = 0; k < d->n_choices; k++) {
            say(problem, k == 0 ? "" : ", ");
            say(problem, d->choices[k]);
        }
        say(problem, " (got ");
        say_quoted(problem, instance->now.content.wrong[i - N_REALS]);
        say(problem, ")");
        return 1;
    }
    if (d->type == STRING) {
        return 0;
    }
    double x = d->type == REAL ? *real_at(instance, i) : *other_at(instance, i);
    int finite = d->type != REAL || (x >= -1e308 && x <= 1e308);
    if (finite && !(x < d->min) && !(x > d->max)) {
        return 0;
    }
    begin_problem(problem, "ValueError", "");
    say(problem, d->name);
    say(problem, !finite ? " must be a finite number" : x < d->min ? " must be at least " : " must be at most ");
    if (finite) {
        say_real(problem, x < d->min ? d->min : d->max, 6);
    }
    say(problem, " (got ");
    if (d->type == REAL) {
        say_real(problem, x, 0);
    } else if (d->type == INTEGER) {
        say_integer(problem, x);
    } else {
        say(problem, x != 0.0 ? "True" : "False");
    }
    say(problem, ")");
    return 1;
}

static int bring_up_to_date(Instance *instance, Problem *problem)
{
    Content *now = &instance->now.content;
    if (now->configured) {
        return 0;
    }
    for (size_t i = N_INPUTS + N_OUTPUTS; i < N_VARIABLES; i++) {
        if (wrong_parameter(instance, i, problem)) {
            return 1;
        }
    }
    if (configure(problem, &now->v, &now->c)) {
        return 1;
    }
    now->configured = 1;
    return 0;
}

static int refresh(Instance *instance, Problem *problem)
{
    Content *now = &instance->now.content;
    double y[sizeof now->y / sizeof *now->y];
    if (bring_up_to_date(instance, problem) ||
        start(problem, &now->v, &now->c, &now->s, instance->now.lists, now->start_time) ||
        output(problem, &now->v, &now->c, &now->s, instance->now.lists, y, now->start_time)) {
        return 1;
    }
    memcpy(now->y, y, sizeof y);
    now->stale = 0;
    return 0;
}

static void begin(Instance *instance)
{
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(instance->now.lists[i].items);
    }
    memset(&instance->now, 0, sizeof instance->now);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        if (DECLARED[i].type == REAL) {
            *real_at(instance, i) = DECLARED[i].start;
        } else {
            *other_at(instance, i) = (int)DECLARED[i].start;
        }
    }
    instance->now.content.initializing = 1;
    instance->now.content.stale = 1;
}

/* ---- life cycle ---- */

FMI2_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

FMI2_EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    Instance *instance = c;
    if (instance == NULL) {
        return;
    }
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(instance->now.lists[i].items);
    }
    free(instance->name);
    free(instance);
}

FMI2_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *host, fmi2Boolean visible,
                                          fmi2Boolean logging_on)
{
    (void)resources, (void)visible, (void)logging_on;
    if (host == NULL) {
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (instance == NULL) {
        return NULL;
    }
    instance->host = *host;
    instance->name = malloc(name == NULL ? 1 : strlen(name) + 1);
    if (instance->name == NULL) {
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name == NULL ? "" : name);
    const char *problem = *instance->name == '\0'         ? "fmi2Instantiate needs an instance name in UTF-8"
                          : type != fmi2CoSimulation ? "this FMU is for co-simulation only"
                          : guid == NULL || strcmp(guid, GUID) != 0
                              ? "the GUID is not that of this FMU: the model description is of another build"
                              : NULL;
    if (problem != NULL) {
        complain(instance, problem);
        fmi2FreeInstance(instance);
        return NULL;
    }
    begin(instance);
    return instance;
}

#define UNIT(c)                                                                                             \
    Instance *instance = (c);                                                                               \
    if (instance == NULL) {                                                                                 \
        return fmi2Error;                                                                                   \
    }                                                                                                       \
    Content *now = &instance->now.content;                                                                  \
    (void)now;

#define REQUIRE(condition, text)                                                                            \
    if (!(condition)) {                                                                                     \
        return complain(instance, text);                                                                    \
    }

FMI2_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                                           fmi2Real start_time, fmi2Boolean stop_defined, fmi2Real stop_time)
{
    UNIT(c)
    Refusal why;
    (void)tolerance_defined, (void)tolerance;
    if (!set_up(&now->at, start_time, stop_defined, stop_time, &why)) {
        return refuse(instance, &why);
    }
    now->start_time = start_time;
    now->stale = 1;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    UNIT(c)
    Refusal why;
    Problem problem;
    if (!pass_on(&now->at, BEFORE_INITIALIZATION, DURING_INITIALIZATION, "fmi2EnterInitializationMode", &why)) {
        return refuse(instance, &why);
    }
    return bring_up_to_date(instance, &problem)
               ? fail(instance, "initialization failed", now->start_time, &problem)
               : fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    UNIT(c)
    Refusal why;
    Problem problem;
    if (!pass_on(&now->at, DURING_INITIALIZATION, AFTER_INITIALIZATION, "fmi2ExitInitializationMode", &why)) {
        return refuse(instance, &why);
    }
    if (now->stale && refresh(instance, &problem)) {
        return fail(instance, "initialization failed", now->start_time, &problem);
    }
    now->initializing = 0;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep)
{
    UNIT(c)
    (void)keep;
    Refusal why;
    Problem problem;
    double y[sizeof now->y / sizeof *now->y];
    if (now->at.failed) {
        return fmi2Error;
    }
    if (!may_step(&now->at, t, h, &why)) {
        return refuse(instance, &why);
    }
    if (advance(&problem, &now->v, &now->c, &now->s, instance->now.lists, t, h) ||
        output(&problem, &now->v, &now->c, &now->s, instance->now.lists, y, t + h)) {
        return fail(instance, "step failed", t, &problem);
    }
    memcpy(now->y, y, sizeof y);
    now->at.time = t + h;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    UNIT(c)
    Refusal why;
    return terminate(&now->at, &why) ? fmi2OK : refuse(instance, &why);
}

FMI2_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    UNIT(c)
    begin(instance);
    return fmi2OK;
}

/* ---- values ---- */

FMI2_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[])
{
    UNIT(c)
    REQUIRE(n == 0 || (r != NULL && values != NULL), "fmi2GetReal: value references or values are missing")
    fmi2Status status = fmi2OK;
    for (size_t i = 0; i < n && now->stale && now->initializing && !now->at.failed; i++) {
        Problem problem;
        if (r[i] >= N_INPUTS && r[i] < N_INPUTS + N_OUTPUTS && refresh(instance, &problem)) {
            status = fail(instance, "initialization failed", now->start_time, &problem);
        }
    }
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= N_REALS) {
            Problem problem;
            for (size_t k = 0; k < n; k++) {
                values[k] = NAN;
            }
            begin_problem(&problem, "TypeError", "");
            say_name(&problem, r[i]);
            say(&problem, " is not of type Real");
            return fail_at(instance, "reading", "Real", r, n, &problem);
        }
        int is_output = r[i] >= N_INPUTS && r[i] < N_INPUTS + N_OUTPUTS;
        values[i] = is_output ? now->y[r[i] - N_INPUTS] : *real_at(instance, r[i]);
    }
    return status;
}

FMI2_EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[])
{
    UNIT(c)
    REQUIRE(n == 0 || (r != NULL && values != NULL), "fmi2SetReal: value references or values are missing")
    for (size_t i = 0; i < n; i++) {
        int is_input = r[i] < N_INPUTS, is_parameter = r[i] >= N_INPUTS + N_OUTPUTS && r[i] < N_REALS;
        if (!is_input && !(is_parameter && now->initializing)) {
            Problem problem;
            begin_problem(&problem, "ValueError", "");
            say_name(&problem, r[i]);
            say(&problem, now->initializing ? " cannot be set" : " cannot be set after initialization");
            return fail_at(instance, "setting", "Real", r, n, &problem);
        }
        *real_at(instance, r[i]) = values[i];
        if (is_parameter) {
            now->configured = 0;
        }
    }
    if (now->initializing) {
        now->stale = 1;
    }
    return fmi2OK;
}

/* Check references of another type than Real; 1 with the problem if one is wrong. */
static int wrong_reference(const fmi2ValueReference r[], size_t n, int type, const char *named, Problem *problem)
{
    for (size_t i = 0; i < n; i++) {
        if (r[i] >= N_VARIABLES || DECLARED[r[i]].type != type) {
            begin_problem(problem, "TypeError", "");
            say_name(problem, r[i]);
            say(problem, " is not of type ");
            say(problem, named);
            return 1;
        }
    }
    return 0;
}

static fmi2Status may_set(Instance *instance, const fmi2ValueReference r[], size_t n, int type, const char *named)
{
    Problem problem;
    if (!instance->now.content.initializing) {
        begin_problem(&problem, "ValueError", "");
        say_name(&problem, r[0]);
        say(&problem, " cannot be set after initialization");
        return fail_at(instance, "setting", named, r, n, &problem);
    }
    if (wrong_reference(r, n, type, named, &problem)) {
        return fail_at(instance, "setting", named, r, n, &problem);
    }
    instance->now.content.configured = 0;
    instance->now.content.stale = 1;
    return fmi2OK;
}

static int code_of(Instance *instance, size_t i, const char *text)
{
    for (int k = 0; k < DECLARED[i].n_choices; k++) {
        if (strcmp(DECLARED[i].choices[k], text) == 0) {
            return k;
        }
    }
    snprintf(instance->now.content.wrong[i - N_REALS], LONGEST_TEXT, "%s", text);
    return -1;
}

static const char *text_of(Instance *instance, size_t i)
{
    int code = *other_at(instance, i);
    return code < 0 ? instance->now.content.wrong[i - N_REALS] : DECLARED[i].choices[code];
}

#define GET_AND_SET(Type, TYPE, BLANK, READ, WRITE)                                                         \
    FMI2_EXPORT fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference r[], size_t n,           \
                                         fmi2##Type values[])                                               \
    {                                                                                                       \
        UNIT(c)                                                                                             \
        REQUIRE(n == 0 || (r != NULL && values != NULL),                                                    \
                "fmi2Get" #Type ": value references or values are missing")                                 \
        Problem problem;                                                                                    \
        if (wrong_reference(r, n, TYPE, #Type, &problem)) {                                                 \
            for (size_t i = 0; i < n; i++) {                                                                \
                values[i] = BLANK;                                                                          \
            }                                                                                               \
            return fail_at(instance, "reading", #Type, r, n, &problem);                                     \
        }                                                                                                   \
        for (size_t i = 0; i < n; i++) {                                                                    \
            values[i] = READ;                                                                               \
        }                                                                                                   \
        return fmi2OK;                                                                                      \
    }                                                                                                       \
    FMI2_EXPORT fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference r[], size_t n,           \
                                         const fmi2##Type values[])                                         \
    {                                                                                                       \
        UNIT(c)                                                                                             \
        REQUIRE(n == 0 || (r != NULL && values != NULL),                                                    \
                "fmi2Set" #Type ": value references or values are missing")                                 \
        fmi2Status status = n == 0 ? fmi2OK : may_set(instance, r, n, TYPE, #Type);                         \
        for (size_t i = 0; i < n && status == fmi2OK; i++) {                                                \
            *other_at(instance, r[i]) = WRITE;                                                              \
        }                                                                                                   \
        return status;                                                                                      \
    }

GET_AND_SET(Integer, INTEGER, 0, *other_at(instance, r[i]), values[i])
GET_AND_SET(Boolean, BOOLEAN, fmi2False, *other_at(instance, r[i]), values[i] != 0)
GET_AND_SET(String, STRING, "", text_of(instance, r[i]), code_of(instance, r[i], values[i] == NULL ? "" : values[i]))

/* ---- state ---- */

static void forget(Saved *saved)
{
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        free(saved->lists[i].items);
    }
}

/* Copy a state, with its lists starting at their first items; false if out of memory. */
static int copy(Saved *to, const Saved *from)
{
    Saved made = {.content = from->content};
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        for (size_t k = 0; k < from->lists[i].count; k++) {
            if (!push(&made.lists[i], WIDTHS[i], item(&from->lists[i], WIDTHS[i], (double)k))) {
                forget(&made);
                return 0;
            }
        }
    }
    forget(to);
    *to = made;
    return 1;
}

FMI2_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    UNIT(c)
    REQUIRE(state != NULL, "fmi2GetFMUstate: no place for the state")
    Saved *saved = *state != NULL ? *state : calloc(1, sizeof *saved);
    if (saved == NULL || !copy(saved, &instance->now)) {
        if (saved != *state) {
            free(saved);
        }
        return complain(instance, "fmi2GetFMUstate: out of memory");
    }
    *state = saved;
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    UNIT(c)
    REQUIRE(state != NULL, "fmi2SetFMUstate: no state given")
    return copy(&instance->now, state) ? fmi2OK : complain(instance, "fmi2SetFMUstate: out of memory");
}

FMI2_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    UNIT(c)
    if (state != NULL && *state != NULL) {
        forget(*state);
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

/* Serialized state: content, count and items of each list, seal. */
FMI2_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    UNIT(c)
    REQUIRE(state != NULL && size != NULL, "fmi2SerializedFMUstateSize: no state, or no place for its size")
    *size = sizeof(Content) + sizeof(Seal);
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        size_t count = ((Saved *)state)->lists[i].count;
        *size += sizeof(uint64_t) + count * (size_t)WIDTHS[i] * sizeof(double);
    }
    return fmi2OK;
}

FMI2_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    UNIT(c)
    REQUIRE(bytes != NULL, "fmi2SerializeFMUstate: no place for the bytes")
    size_t needed;
    fmi2Status status = fmi2SerializedFMUstateSize(c, state, &needed);
    if (status != fmi2OK) {
        return status;
    }
    REQUIRE(size >= needed, "fmi2SerializeFMUstate: the place for the bytes is too small")
    const Saved *saved = state;
    char *end = bytes;
    memcpy(end, &saved->content, sizeof saved->content), end += sizeof saved->content;
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        uint64_t count = saved->lists[i].count;
        size_t one = (size_t)WIDTHS[i] * sizeof(double);
        memcpy(end, &count, sizeof count), end += sizeof count;
        for (size_t k = 0; k < count; k++) {
            memcpy(end, item(&saved->lists[i], WIDTHS[i], (double)k), one), end += one;
        }
    }
    seal(GUID, bytes, (size_t)(end - bytes));
    return fmi2OK;
}

static int read_state(Saved *saved, const char *bytes, size_t size)
{
    const char *end = bytes + size - sizeof(Seal);
    if (!is_sealed(GUID, bytes, size) || size < sizeof(Content) + sizeof(Seal)) {
        return 0;
    }
    memcpy(&saved->content, bytes, sizeof(Content)), bytes += sizeof(Content);
    for (size_t i = 0; i < (size_t)N_LISTS; i++) {
        uint64_t count;
        size_t one = (size_t)WIDTHS[i] * sizeof(double);
        if ((size_t)(end - bytes) < sizeof count) {
            return 0;
        }
        memcpy(&count, bytes, sizeof count), bytes += sizeof count;
        if (count > (size_t)(end - bytes) / one) {
            return 0;
        }
        for (uint64_t k = 0; k < count; k++, bytes += one) {
            if (!push(&saved->lists[i], WIDTHS[i], bytes)) {
                return 0;
            }
        }
    }
    return bytes == end;
}

FMI2_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state)
{
    UNIT(c)
    REQUIRE(bytes != NULL && state != NULL, "fmi2DeSerializeFMUstate: no bytes, or no place for the state")
    Saved *saved = calloc(1, sizeof *saved);
    if (saved == NULL || !read_state(saved, bytes, size)) {
        if (saved != NULL) {
            forget(saved);
        }
        free(saved);
        return complain(instance, "fmi2DeSerializeFMUstate: not a state of this FMU");
    }
    fmi2FreeFMUstate(c, state);
    *state = saved;
    return fmi2OK;
}

/* ---- functions that are not supported ---- */

FMI2_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    UNIT(c)
    (void)on;
    REQUIRE(n == 0 || names != NULL, "fmi2SetDebugLogging: no categories given")
    return fmi2OK; /* only errors are logged, and always */
}

FMI2_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    UNIT(c)
    REQUIRE(value != NULL, "fmi2GetRealStatus: no place for the value")
    REQUIRE(kind == fmi2LastSuccessfulTime, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone")
    *value = now->at.time;
    return fmi2OK;
}

#define UNSUPPORTED(name, parameters, ...)                                                                  \
    FMI2_EXPORT fmi2Status fmi2##name parameters                                                            \
    {                                                                                                       \
        __VA_ARGS__;                                                                                        \
        UNIT(c)                                                                                             \
        return complain(instance, "fmi2" #name " is not supported");                                        \
    }
FMI2_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
