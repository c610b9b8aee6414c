#include "formats/volume/data_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "formats/volume/readers.h"
#include "formats/volume/words.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;

class JoinedStream final : public InputStream {
 public:
  JoinedStream(const std::string& name, std::vector<std::string> paths, uint64_t part_bytes,
               std::function<Result<std::unique_ptr<InputStream>>(const std::string&)> open)
      : paths_(std::move(paths)), part_bytes_(part_bytes), open_(std::move(open)) {
    name_ = name;
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size() && (left_ > 0 || next_ < paths_.size())) {
      if (left_ == 0) {
        VOX_TRY(part_, open_(paths_[next_++]));
        left_ = part_bytes_;
      }
      const size_t want = static_cast<size_t>(std::min<uint64_t>(left_, out.size() - done));
      VOX_TRY(const size_t got, part_->read(out.subspan(done, want)));
      done += got;
      position_ += got;
      left_ -= got;
      if (got < want)
        return bad_input(part_->name(), fmt::format("voxel data end after {} bytes: expected {}",
                                                    part_bytes_ - left_, part_bytes_));
      if (left_ == 0) VOX_CHECK(part_->check_end());
    }
    return done;
  }
  Status skip(uint64_t count) override {
    for (; left_ == 0 && next_ < paths_.size() && count >= part_bytes_; ++next_) {
      count -= part_bytes_;
      position_ += part_bytes_;
    }
    return InputStream::skip(count);
  }

 private:
  std::vector<std::string> paths_;
  uint64_t part_bytes_;
  std::function<Result<std::unique_ptr<InputStream>>(const std::string&)> open_;
  std::unique_ptr<InputStream> part_;
  uint64_t left_ = 0;
  size_t next_ = 0;
};

}  // namespace

Result<std::string> data_file_path(const std::string& header, const std::string& folder,
                                   const std::string& name, const OpenOptions& options) {
  const auto wrong = [&](const std::string& what) {
    return bad_input(header, fmt::format("data file \"{}\": {}", name.substr(0, 200), what));
  };
  if (name.empty()) return wrong("expected the name of a file");
  if (!options.allow_outside && leaves_folder(folder, name))
    return wrong("lies outside of the header's folder: expected --allow-outside");
  std::string path = (fs::path(folder) / name).string();
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return bad_input(path, error ? error.message() : "No such file or directory");
  if (!fs::is_regular_file(status)) return wrong("is not a regular file");
  return path;
}

std::string DataFiles::name(int64_t i) const {
  if (!listed.empty()) return listed[static_cast<size_t>(i)];
  const int64_t value = first + i * step;
  return pad == '0' ? fmt::format("{}{:0{}}{}", prefix, value, width, suffix)
                    : fmt::format("{}{:{}}{}", prefix, value, width, suffix);
}

std::optional<DataFiles> parse_data_pattern(const std::vector<std::string_view>& words) {
  if (words.size() < 4) return std::nullopt;
  DataFiles files;
  const std::string_view pattern = words[0];
  const size_t percent = pattern.find('%');
  if (percent == pattern.npos) return std::nullopt;
  size_t end = percent + 1;
  if (end < pattern.size() && pattern[end] == '0') files.pad = '0', ++end;
  while (end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9' && files.width < 100)
    files.width = files.width * 10 + (pattern[end++] - '0');
  if (end == pattern.size() || pattern[end] != 'd' || files.width > 100) return std::nullopt;
  files.prefix = pattern.substr(0, percent);
  files.suffix = pattern.substr(end + 1);
  const auto first = number<int32_t>(words[1]), last = number<int32_t>(words[2]),
             step = number<int32_t>(words[3]);
  if (!first || !last || !step || *step == 0 || (*last - int64_t{*first}) / *step < 0) return std::nullopt;
  files.first = *first;
  files.step = *step;
  files.count = (*last - int64_t{*first}) / *step + 1;
  return files;
}

std::string detached_data_file(const std::string& path) {
  if (!has_ending(path, ".nhdr") && !has_ending(path, ".mhd")) return {};
  return fs::path(path).replace_extension(".raw").string();
}

std::unique_ptr<InputStream> join_files(
    const std::string& name, std::vector<std::string> paths, uint64_t part_bytes,
    std::function<Result<std::unique_ptr<InputStream>>(const std::string& path)> open) {
  return std::make_unique<JoinedStream>(name, std::move(paths), part_bytes, std::move(open));
}

}  // namespace voxkit
