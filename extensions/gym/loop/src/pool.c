/* pool.c - divides work among threads that the caller provides. */
#include "pool.h"

/* ----------------------------------------------------------------------------------------------
 * the system's locks and signals */

#ifdef _WIN32
static void open_lock(hxLock *lock) { InitializeSRWLock(lock); }
static void close_lock(hxLock *lock) { (void)lock; }
static void take(hxLock *lock) { AcquireSRWLockExclusive(lock); }
static void release(hxLock *lock) { ReleaseSRWLockExclusive(lock); }
static void open_signal(hxSignal *signal) { InitializeConditionVariable(signal); }
static void close_signal(hxSignal *signal) { (void)signal; }
static void await(hxSignal *signal, hxLock *lock) {
  SleepConditionVariableSRW(signal, lock, INFINITE, 0);
}
static void notify(hxSignal *signal) { WakeAllConditionVariable(signal); }
#else
static void open_lock(hxLock *lock) { pthread_mutex_init(lock, NULL); }
static void close_lock(hxLock *lock) { pthread_mutex_destroy(lock); }
static void take(hxLock *lock) { pthread_mutex_lock(lock); }
static void release(hxLock *lock) { pthread_mutex_unlock(lock); }
static void open_signal(hxSignal *signal) { pthread_cond_init(signal, NULL); }
static void close_signal(hxSignal *signal) { pthread_cond_destroy(signal); }
static void await(hxSignal *signal, hxLock *lock) { pthread_cond_wait(signal, lock); }
static void notify(hxSignal *signal) { pthread_cond_broadcast(signal); }
#endif

/* ----------------------------------------------------------------------------------------------
 * work */

void hx_pool_open(hxPool *pool) {
  open_lock(&pool->lock);
  open_signal(&pool->begin);
  open_signal(&pool->end);
  pool->next = pool->done = pool->count = 0;
  pool->stopped = 0;
}

void hx_pool_close(hxPool *pool) {
  close_signal(&pool->end);
  close_signal(&pool->begin);
  close_lock(&pool->lock);
}

/* Takes and does items while there are any; the lock is held at entry and at return. */
static void work_off(hxPool *pool, void *own) {
  while (pool->next < pool->count) {
    const size_t first = pool->next, left = pool->count - first;
    const size_t taken = left < pool->chunk ? left : pool->chunk;
    pool->next += taken;
    release(&pool->lock);
    for (size_t i = first; i < first + taken; ++i) pool->work(pool->owner, i, own);
    take(&pool->lock);
    pool->done += taken;
  }
  if (pool->done == pool->count) notify(&pool->end);
}

void hx_pool_run(hxPool *pool, hxWork *work, void *owner, size_t count, void *own) {
  take(&pool->lock);
  pool->work = work;
  pool->owner = owner;
  pool->next = pool->done = 0;
  pool->count = count;
  /* small enough that no thread waits long for the last one, large enough to lock rarely */
  pool->chunk = count / 64 + 1;
  notify(&pool->begin);
  work_off(pool, own);
  while (pool->done < count) await(&pool->end, &pool->lock);
  release(&pool->lock);
}

void hx_pool_serve(hxPool *pool, void *own) {
  take(&pool->lock);
  while (!pool->stopped) {
    work_off(pool, own);
    if (!pool->stopped && pool->next >= pool->count) await(&pool->begin, &pool->lock);
  }
  release(&pool->lock);
}

void hx_pool_stop(hxPool *pool) {
  take(&pool->lock);
  pool->stopped = 1;
  notify(&pool->begin);
  release(&pool->lock);
}
