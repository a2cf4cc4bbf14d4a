/* memory_files.h - the files of an FMU's resources in memory, for a module without a file system
 *
 * The component is compiled with -Dfopen=hx_memory_open and so on (cosim/export/wasm_component.py),
 * so that its code reads them as it reads files elsewhere. Only reading is possible.
 */
#ifndef HEXAPOD_MEMORY_FILES_H
#define HEXAPOD_MEMORY_FILES_H

#include <stdint.h>
#include <stdio.h>

/* Allocates the block of `size` bytes that holds the files, which the caller fills: for each file,
 * its path within the resources, a zero byte, its size as 4 bytes, the lowest first, and its
 * contents. */
unsigned char *hx_memory_block(size_t size);

/* As the functions of stdio.h. The path may begin with any folder. */
FILE *hx_memory_open(const char *path, const char *mode);
int hx_memory_close(FILE *file);
int hx_memory_getc(FILE *file);
size_t hx_memory_read(void *place, size_t size, size_t count, FILE *file);
int hx_memory_seek(FILE *file, long offset, int origin);
long hx_memory_tell(FILE *file);

#endif
