/* memory_files.c - reads the files of an FMU's resources from memory */
#include "memory_files.h"

#include <stdlib.h>
#include <string.h>

typedef struct hxMemoryFile {
  const unsigned char *bytes;
  size_t size, at;
} hxMemoryFile;

static unsigned char *block;
static size_t block_size;

unsigned char *hx_memory_block(size_t size) {
  block = malloc(size ? size : 1);
  block_size = block ? size : 0;
  return block;
}

/* Returns whether a path ends in a file's name, as a whole component of the path. */
static int is_path_of(const char *path, const char *name) {
  const size_t length = strlen(path), tail = strlen(name);
  if (length < tail || strcmp(path + length - tail, name) != 0) return 0;
  return length == tail || path[length - tail - 1] == '/';
}

/* Reads the entry at a place of the block; returns the place behind it. */
static size_t read_entry(size_t place, const char **name, hxMemoryFile *file) {
  *name = (const char *)block + place;
  const unsigned char *size = block + place + strlen(*name) + 1;
  file->size = size[0] | (size_t)size[1] << 8 | (size_t)size[2] << 16 | (size_t)size[3] << 24;
  file->bytes = size + 4;
  file->at = 0;
  return (size_t)(file->bytes - block) + file->size;
}

FILE *hx_memory_open(const char *path, const char *mode) {
  hxMemoryFile file;
  const char *name;
  (void)mode;
  for (size_t place = 0; place < block_size;) {
    place = read_entry(place, &name, &file);
    if (!is_path_of(path, name)) continue;
    hxMemoryFile *opened = malloc(sizeof *opened);
    if (opened) *opened = file;
    return (FILE *)(void *)opened;
  }
  return NULL;
}

int hx_memory_close(FILE *file) {
  free(file);
  return 0;
}

int hx_memory_getc(FILE *file) {
  hxMemoryFile *own = (hxMemoryFile *)(void *)file;
  return own->at < own->size ? own->bytes[own->at++] : EOF;
}

size_t hx_memory_read(void *place, size_t size, size_t count, FILE *file) {
  hxMemoryFile *own = (hxMemoryFile *)(void *)file;
  const size_t left = (own->size - own->at) / size, read = count < left ? count : left;
  memcpy(place, own->bytes + own->at, read * size);
  own->at += read * size;
  return read;
}

int hx_memory_seek(FILE *file, long offset, int origin) {
  hxMemoryFile *own = (hxMemoryFile *)(void *)file;
  const size_t from = origin == SEEK_SET ? 0 : origin == SEEK_CUR ? own->at : own->size;
  const long place = (long)from + offset;
  if (place < 0 || (size_t)place > own->size) return -1;
  own->at = (size_t)place;
  return 0;
}

long hx_memory_tell(FILE *file) {
  const hxMemoryFile *own = (const hxMemoryFile *)(const void *)file;
  return (long)own->at;
}
