// Any bytes as a container: as they are, and with what opening asks for made right.
#include "formats/container.h"
#include "formats/volume_chunks.h"

#include <cstdio>
#include <cstdlib>

#include "tests/damage.h"

namespace {

using namespace voxkit;

[[noreturn]] void stop(const std::string& fault) {
  std::fprintf(stderr, "%s\n", fault.c_str());
  std::abort();
}

/// Chunks that say truly that they are long take memory.
void expect_sound(const Error& error) {
  if ((error.code != ErrorCode::input && error.code != ErrorCode::limit) || error.what.empty() ||
      error.what.find('\n') != std::string::npos)
    stop("not an error of the input in one line: " + error.what);
}

void read(const test::Bytes& file) {
  const auto bytes = std::make_shared<const test::Bytes>(file.begin(), file.end());
  MemoryBudget memory(uint64_t{64} << 20);
  const auto container = Container::open(*bytes, "fuzz", bytes, &memory);
  if (!container) return expect_sound(container.error());
  const auto& table = (*container)->table();
  uint64_t end = 64;
  for (size_t i = 0; i < table.size(); ++i) {
    if (table[i].offset < end || table[i].offset % 64 != 0 ||
        table[i].offset + table[i].stored > file.size() - 64)
      stop("a chunk where none may be");
    end = table[i].offset + table[i].stored;
    const auto chunk = (*container)->chunk(i);
    if (!chunk) {
      expect_sound(chunk.error());
    } else if (table[i].compressed()) {
      if (chunk->size() != table[i].length) stop("an expanded chunk of another length");
    } else if (test::checksum(*chunk) != table[i].checksum ||
               chunk->data() != bytes->data() + table[i].offset) {
      stop("not the bytes of the chunk");
    }
  }
  if (const auto chunk = (*container)->only_chunk(volume_info_kind); !chunk) {
    expect_sound(chunk.error());
  } else if (const auto info = unpack_volume_info(*chunk, {}, "fuzz"); !info) {
    expect_sound(info.error());
  } else if (!checked_voxels(info->dims) || voxel_bytes(info->format) == 0) {
    stop("a volume that cannot be");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto input = std::as_bytes(std::span(data, size));
  test::Bytes file(input.begin(), input.end());
  read(file);
  test::repair(file);
  read(file);
  return 0;
}
