// Writing an image by OpenImageIO, which keeps quiet about some of what goes wrong on a disk.
#pragma once

#include <OpenImageIO/imageio.h>

#include <memory>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// One image, from its first row to its last. Its bytes go through our own hands where the library lets
/// them: what cannot be written is found then, and by looking at the finished file otherwise.
class CheckedImageOutput {
 public:
  /// `name`: for messages. `path`: of the file that is written, which is made new or cut to nothing.
  CheckedImageOutput(std::string name, std::string path);
  ~CheckedImageOutput();
  CheckedImageOutput(const CheckedImageOutput&) = delete;
  CheckedImageOutput& operator=(const CheckedImageOutput&) = delete;

  /// `format`: OpenImageIO's name of it. Errors, here and below: ErrorCode::output.
  Status open(const std::string& format, const OIIO::ImageSpec& spec);
  /// Rows y0 .. y1, without gaps.
  Status write(int64_t y0, int64_t y1, OIIO::TypeDesc type, const void* rows);
  /// Completes the file. Only then it is whole.
  Status close();

 private:
  class File;
  tl::unexpected<Error> failed(const std::string& why) const;

  std::string name_, path_, format_;
  std::unique_ptr<File> file_;
  std::unique_ptr<OIIO::ImageOutput> output_;
};

}  // namespace voxkit
