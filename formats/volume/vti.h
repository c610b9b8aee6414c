// VTK's image data as XML: what a file says, and the bytes of an array.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/context.h"
#include "formats/mapped_file.h"
#include "formats/volume.h"
#include "formats/volume/open_volume.h"
#include "formats/volume/vti_blocks.h"

namespace voxkit::vti {

enum class Coding { text, base64, raw };

/// An array of a value or more at each point, or in each cell.
struct Array {
  std::string name;
  std::optional<SampleType> type;
  std::string type_name;
  int64_t components = 1;
  Coding coding = Coding::text;
  uint64_t at = 0;  ///< of its first character in the file; of appended data in `Document::appended`
  bool appended = false;
  bool cells = false;
};

/// What a file says, up to its appended data.
struct Document {
  std::string name;  ///< of the file, for messages
  bool big_endian = false;
  int length_bytes = 4;  ///< of the counts before data
  Packing packing = Packing::none;
  Box extent;  ///< of points
  Affine affine;
  std::vector<Array> arrays;
  std::optional<uint64_t> appended;  ///< where the appended data are
  bool appended_base64 = false;
};

/// Reads the elements. Errors: ErrorCode::input.
Result<Document> read_document(const MappedFile& file);

/// The bytes of an array, as one of three. Samples of text are in the machine's byte order.
struct Data {
  std::unique_ptr<InputStream> stream;
  std::shared_ptr<BlockFile> blocks;
  std::optional<uint64_t> raw_at;  ///< where they are in the file as they are
};
Result<Data> open_data(std::shared_ptr<const MappedFile> file, const Document& document, const Array& array,
                       uint64_t bytes, Context& ctx);

}  // namespace voxkit::vti
