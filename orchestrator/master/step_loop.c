/* Step loop: walks the step programs of a run, many communication steps per call.

   `compiled_loop.py` lays out the structures, compiles this file and explains when `walk` returns to Python;
   the loop in `master.py` is the reference. Compiled without contraction to fused operations, so that every
   sum has the same bits in both. */

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>
#include <unistd.h>

enum kind { END, CALL, COPY, BLEND, CONVERT, SERIES, DISTURB, EXCHANGE_2, EXCHANGE_3, STEP_2, STEP_3 };

enum answer { FINISHED, INTERRUPTED, PYTHON, STATUS, NOT_FINITE, PAUSED };

/* What an FMI 3.0 step answers. */
struct step_answers {
    bool event, ended, early;
    double reached;
};

/* Where the run is (`RunPosition` in Python): it is read when this process dies. */
struct position {
    int64_t completed, call;
    double returned;
};

/* A call on behalf of an instance; what is not needed by its kind is zero. */
struct operation {
    int64_t kind, count;
    void *function, *instance;
    const uint32_t *references;
    int64_t n_references;
    double *values;                 /* exchanged with an FMU, or written */
    const int64_t *first, *second;  /* indices into the pool */
    const double *factors, *terms;  /* gains and offsets, or weights of two samples */
    const double *time, *size;      /* of a step */
    struct step_answers *answers;
    int64_t *row;                   /* of a series: the next one; of faults: the time passed, over `scale` */
    int64_t further, scale;         /* of faults: time of a step, over `scale` */
    int64_t call;                   /* number of the call in the position */
};

struct clock {
    int64_t period;
    double *time;
};

struct run {
    int64_t k, at, end;             /* the point being stepped to, the operation of its program, the last point */
    int64_t first;                  /* point of the first program and row */
    const struct operation *const *programs;
    int64_t n_programs;             /* after which they repeat */
    const struct clock *clocks;
    int64_t n_clocks;
    int64_t start, step, scale;     /* the k-th point is at (start + k step) / scale */
    double *pool;
    int64_t time_at;                /* index of the time in the pool */
    const int64_t *expected;        /* indices of outputs that are checked to be finite */
    int64_t n_expected;
    const int64_t *recorded;        /* indices of the values of a row */
    int64_t n_recorded;
    double *rows;
    int64_t stride;                 /* from row to row */
    struct position *position;
    const int32_t *stop;
    int64_t pause;                  /* time after which Python gets a turn [ns] */
    int64_t status;
};

/* Whether this process is a copy that an FMU has made by `fork` since the walk began. */
static volatile bool copied;

static void note_copy(void)
{
    copied = true;
}

__attribute__((constructor)) static void ask_for_copies(void)
{
    pthread_atfork(NULL, NULL, note_copy);
}

typedef int exchange_2(void *, const uint32_t *, size_t, double *);
typedef int exchange_3(void *, const uint32_t *, size_t, double *, size_t);
typedef int step_2(void *, double, double, int);
typedef int step_3(void *, double, double, bool, bool *, bool *, bool *, double *);

static int64_t now(void)
{
    struct timespec time;
#ifdef CLOCK_MONOTONIC_COARSE
    clock_gettime(CLOCK_MONOTONIC_COARSE, &time);
#else
    clock_gettime(CLOCK_MONOTONIC, &time);
#endif
    return 1000000000 * (int64_t)time.tv_sec + time.tv_nsec;
}

static double point(const struct run *run, int64_t k)
{
    return (double)(run->start + k * run->step) / (double)run->scale;
}

static void copy(const double *pool, const struct operation *op)
{
    for (int64_t i = 0; i < op->count; i++)
        op->values[i] = pool[op->first[i]];
}

static void blend(const double *pool, const struct operation *op)
{
    for (int64_t i = 0; i < op->count; i++)
        op->values[i] = pool[op->first[i]] * op->factors[i] + pool[op->second[i]] * op->terms[i];
}

static void convert(const struct operation *op)
{
    for (int64_t i = 0; i < op->count; i++)
        op->values[i] = op->values[i] * op->factors[i] + op->terms[i];
}

static void feed(double *pool, const struct operation *op)
{
    const double *row = op->factors + *op->row * op->count;
    for (int64_t i = 0; i < op->count; i++)
        pool[op->first[i]] = row[i];
    ++*op->row;
}

/* Faults, each with its begin, end, gain and offset. */
static void disturb(const struct operation *op)
{
    for (int64_t i = 0; i < op->count; i++) {
        const double *fault = op->factors + 4 * i;
        const double time = (double)(op->second[i] + *op->row) / (double)op->scale;
        double *value = op->values + op->first[i];
        if (fault[0] <= time && time < fault[1])
            *value = *value * fault[2] + fault[3];
    }
    *op->row += op->further;
}

static int exchange(const struct operation *op)
{
    if (op->kind == EXCHANGE_2)
        return ((exchange_2 *)op->function)(op->instance, op->references, op->n_references, op->values);
    return ((exchange_3 *)op->function)(op->instance, op->references, op->n_references, op->values, op->count);
}

static int take_step(const struct operation *op)
{
    if (op->kind == STEP_2)
        return ((step_2 *)op->function)(op->instance, *op->time, *op->size, 1);
    struct step_answers *to = op->answers;
    return ((step_3 *)op->function)(op->instance, *op->time, *op->size, true,
                                    &to->event, &to->ended, &to->early, &to->reached);
}

/* Do the rest of a step's program, from `run->at`; return FINISHED, or what Python has to see to first. */
static enum answer work(struct run *run)
{
    const struct operation *program = run->programs[(run->k - run->first) % run->n_programs], *op;
    for (; (op = program + run->at)->kind != END; run->at++) {
        run->status = 0;
        switch ((enum kind)op->kind) {
        case COPY:
            copy(run->pool, op);
            continue;
        case BLEND:
            blend(run->pool, op);
            continue;
        case CONVERT:
            convert(op);
            continue;
        case SERIES:
            if (*op->row == op->n_references)
                return PYTHON;  /* the next rows are to be sampled */
            feed(run->pool, op);
            continue;
        case DISTURB:
            disturb(op);
            continue;
        case EXCHANGE_2:
        case EXCHANGE_3:
            run->position->call = op->call;
            run->status = exchange(op);
            if (copied)
                _exit(1);
            break;
        case STEP_2:
        case STEP_3:
            run->position->call = op->call;
            run->status = take_step(op);
            if (copied)
                _exit(1);
            if (op->answers && (op->answers->early || op->answers->ended))
                return STATUS;
            break;
        default:
            return PYTHON;
        }
        if (run->status)
            return STATUS;
    }
    return FINISHED;
}

static bool all_finite(const struct run *run)
{
    double sum = 0.0;
    for (int64_t i = 0; i < run->n_expected; i++)
        sum += run->pool[run->expected[i]] * 0.0;  /* 0 of a finite number, else NaN */
    return sum == 0.0;
}

static void begin_step(struct run *run)
{
    for (int64_t i = 0; i < run->n_clocks; i++) {
        const struct clock *clock = run->clocks + i;
        if (run->k % clock->period == 0)
            *clock->time = point(run, run->k - clock->period);
    }
    run->at = 0;
}

static void record(struct run *run)
{
    double *row = run->rows + (run->k - run->first) * run->stride;
    run->pool[run->time_at] = point(run, run->k);
    for (int64_t i = 0; i < run->n_recorded; i++)
        row[i] = run->pool[run->recorded[i]];
    run->position->completed = run->k;
}

/* Step to `run->end`, or until Python is needed. To go on, Python increments `at` past an operation that it
   has seen to; `at` is -1 between two steps, and -2 once the outputs of a step have been checked. */
__attribute__((visibility("default"))) int walk(struct run *run)
{
    const int64_t later = now() + run->pause;
    copied = false;
    for (; run->k <= run->end; run->k++) {
        if (run->at == -1) {
            if (*run->stop)
                return INTERRUPTED;
            if (now() > later)
                return PAUSED;
            begin_step(run);
        }
        if (run->at != -2) {
            enum answer answer = work(run);
            if (answer != FINISHED)
                return answer;
            run->position->call = -1;
            if (!all_finite(run))
                return NOT_FINITE;
        }
        record(run);
        run->at = -1;
    }
    return FINISHED;
}
