#include "formats/mesh/lzf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "formats/context.h"

namespace voxkit {
namespace {

constexpr size_t window = 8192, longest = 264;

}  // namespace

Status unpack_lzf(std::span<const std::byte> packed, uint64_t size, const std::string& name,
                  const std::function<Status(std::span<const std::byte>)>& sink) {
  const auto bad = [&](size_t at, const std::string& what) {
    return bad_input(name, fmt::format("corrupt LZF data: byte {}: {}", at, what));
  };
  // What copies may lead back to, then what the sink has not had.
  std::vector<std::byte> out(size_t{1} << 16);
  size_t filled = 0, given = 0, at = 0;
  uint64_t total = 0;
  while (at < packed.size()) {
    const size_t begin = at;
    const auto control = std::to_integer<size_t>(packed[at++]);
    if (filled + longest > out.size()) {
      VOX_CHECK(check_interrupt());
      VOX_CHECK(sink(std::span(out).subspan(given, filled - given)));
      std::memmove(out.data(), out.data() + filled - window, window);
      filled = given = window;
    }
    size_t length = 0;
    if (control < 32) {
      length = control + 1;
      if (length > packed.size() - at)
        return bad(begin, fmt::format("{} bytes follow: there are {}", length, packed.size() - at));
      std::memcpy(out.data() + filled, packed.data() + at, length);
      at += length;
    } else {
      length = (control >> 5) + 2;
      const size_t further = length == 9 ? 2 : 1;
      if (further > packed.size() - at) return bad(begin, "the data ends within a copy");
      if (length == 9) length += std::to_integer<size_t>(packed[at++]);
      const size_t back = ((control & 31) << 8 | std::to_integer<size_t>(packed[at++])) + 1;
      if (back > filled)
        return bad(begin, fmt::format("a copy of what is {} bytes back: expected at most {}", back, total));
      std::byte* const to = out.data() + filled;
      for (size_t i = 0; i < length; ++i)
        to[i] = to[static_cast<ptrdiff_t>(i) - static_cast<ptrdiff_t>(back)];
    }
    filled += length;
    total += length;
    if (total > size) return bad(begin, fmt::format("it becomes more than {} bytes", size));
  }
  if (total != size)
    return bad(at, fmt::format("the data ends after {} unpacked bytes: expected {}", total, size));
  return sink(std::span(out).subspan(given, filled - given));
}

}  // namespace voxkit
