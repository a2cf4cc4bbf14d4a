/* pool.h - divides work among threads that the caller provides. */
#ifndef HX_POOL_H
#define HX_POOL_H

#include <stddef.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
typedef SRWLOCK hxLock;
typedef CONDITION_VARIABLE hxSignal;
#else
#include <pthread.h>
typedef pthread_mutex_t hxLock;
typedef pthread_cond_t hxSignal;
#endif

/* Does item `index` of the work in a thread that has memory of its own. */
typedef void hxWork(void *owner, size_t index, void *own);

typedef struct hxPool {
  hxLock lock;
  hxSignal begin, end;
  hxWork *work;
  void *owner;
  size_t next, done, count; /* items: first one that nobody has taken, finished, all */
  size_t chunk;             /* items that a thread takes at once */
  int stopped;
} hxPool;

void hx_pool_open(hxPool *pool);
void hx_pool_close(hxPool *pool);

/* Does all items in this thread and in those that serve; returns when the last one is done. own:
 * passed to the work that this thread does. */
void hx_pool_run(hxPool *pool, hxWork *work, void *owner, size_t count, void *own);

/* Takes part in all calls of hx_pool_run until hx_pool_stop. */
void hx_pool_serve(hxPool *pool, void *own);
void hx_pool_stop(hxPool *pool);

#endif
