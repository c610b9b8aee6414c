// TIFF files by hand, tag by tag, of either byte order and either size of offsets.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace voxkit {

/// One directory: numbers of its tags, texts, ratios, and its strips or tiles.
struct TiffBuilderPage {
  std::map<int, std::vector<uint64_t>> tags;  ///< as LONG, or SHORT where all are below 65536
  std::map<int, std::string> texts;
  std::map<int, std::pair<uint32_t, uint32_t>> ratios;
  std::vector<std::string> chunks;
};

struct TiffBuilder {
  std::vector<TiffBuilderPage> pages = {};
  bool big_endian = false, big = false;

  std::string bytes() const {
    std::string file = big_endian ? "MM" : "II";
    put(file, big ? 43 : 42, 2);
    if (big) put(file, 8, 2), put(file, 0, 2);
    size_t link = file.size();
    put(file, 0, big ? 8 : 4);
    for (const TiffBuilderPage& page : pages) {
      std::vector<uint64_t> offsets, counts;
      for (const std::string& chunk : page.chunks) {
        offsets.push_back(file.size());
        counts.push_back(chunk.size());
        file += chunk;
        if (file.size() % 2) file += '\0';
      }
      std::map<int, std::string> values;  // type, count and value, or where it lies
      const auto add = [&](int tag, int type, uint64_t count, std::string raw) {
        std::string entry;
        put(entry, static_cast<uint64_t>(tag), 2), put(entry, static_cast<uint64_t>(type), 2),
            put(entry, count, big ? 8 : 4);
        const size_t room = big ? 8 : 4;
        if (raw.size() > room) {
          put(entry, file.size(), big ? 8 : 4);
          file += raw;
          if (file.size() % 2) file += '\0';
        } else {
          raw.resize(room, '\0');
          entry += raw;
        }
        values[tag] = entry;
      };
      auto tags = page.tags;
      const bool tiled = tags.contains(322);
      if (!tags.contains(273) && !tags.contains(324)) tags[tiled ? 324 : 273] = offsets;
      if (!tags.contains(279) && !tags.contains(325)) tags[tiled ? 325 : 279] = counts;
      for (const auto& [tag, numbers] : tags) {
        if (numbers.empty()) continue;
        bool small = tag != 273 && tag != 279 && tag != 324 && tag != 325;
        for (const uint64_t v : numbers) small = small && v < 65536;
        std::string raw;
        for (const uint64_t v : numbers) put(raw, v, small ? 2 : 4);
        add(tag, small ? 3 : 4, numbers.size(), raw);
      }
      for (const auto& [tag, text] : page.texts) add(tag, 2, text.size() + 1, text + '\0');
      for (const auto& [tag, ratio] : page.ratios) {
        std::string raw;
        put(raw, ratio.first, 4), put(raw, ratio.second, 4);
        add(tag, 5, 1, raw);
      }
      std::string at;
      put(at, file.size(), big ? 8 : 4);
      file.replace(link, at.size(), at);
      put(file, values.size(), big ? 8 : 2);
      for (const auto& [tag, entry] : values) file += entry;
      link = file.size();
      put(file, 0, big ? 8 : 4);
    }
    return file;
  }

  void put(std::string& to, uint64_t value, int bytes) const {
    for (int i = 0; i < bytes; ++i) to += static_cast<char>(value >> (8 * (big_endian ? bytes - 1 - i : i)));
  }
  /// Samples of so many bytes in the byte order of the file.
  std::string samples(const std::vector<uint64_t>& values, int bytes) const {
    std::string raw;
    for (const uint64_t v : values) put(raw, v, bytes);
    return raw;
  }
};

/// A page of one strip of grey samples.
inline TiffBuilderPage grey_page(uint64_t width, uint64_t height, uint64_t bits, const std::string& pixels) {
  TiffBuilderPage page;
  page.tags = {{256, {width}}, {257, {height}}, {258, {bits}},  {259, {1}},
               {262, {1}},     {277, {1}},      {278, {height}}};
  page.chunks = {pixels};
  return page;
}

}  // namespace voxkit
