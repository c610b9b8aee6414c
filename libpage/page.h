// Pages: boxes of up to 16^3 samples, predicted, quantised within a bound, entropy-coded, each decodable
// alone with a model that many pages share. Samples are unsigned integers of 8, 16 or 32 bits, x fastest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/result.h"
#include "libpage/extent.h"
#include "libpage/mask.h"

namespace voxkit::page {

struct ModelData;

/// What the pages of a volume, or of a region of it, are coded with: weights of the prediction, tables of
/// probabilities, the bound, a palette. Immutable; copies share what they hold; safe to use from many
/// threads.
class Model {
 public:
  /// Safe on any bytes: a model, or ErrorCode::input that names the field that is wrong.
  static Result<Model> parse(std::span<const std::byte> bytes);
  /// The bytes that `parse` takes: 1 to 4 KB as a rule.
  std::vector<std::byte> serialise() const;

  /// Whether its pages can be coded and decoded only beside those of the next coarser level.
  bool has_parents() const;
  /// Whether values are coded as names.
  bool has_labels() const;
  uint32_t max_error() const;
  /// The greatest sample that a page of this model can hold.
  uint32_t max_sample() const;
  /// What a page of no bytes is full of.
  uint32_t background() const;
  /// A page of at most so many bytes is full of one sample.
  size_t value_bytes() const;
  /// For the library itself.
  const ModelData& data() const { return *data_; }
  explicit Model(std::shared_ptr<const ModelData> data) : data_(std::move(data)) {}

 private:
  std::shared_ptr<const ModelData> data_;
};

/// A page of the next coarser level, of which each voxel, the parent, stands for 2^3 children: what is known
/// of a page from it. Voxel (i, j, k) of the page is a child of (x + i / 2, y + j / 2, z + k / 2) of this.
template <class T>
struct Parent {
  std::span<const T> samples;  ///< as they were decoded: `extent.voxels()` of them
  Extent extent{};
  int x = 0, y = 0, z = 0;
};

struct ModelOptions {
  /// No decoded sample is further from its original than this; 0: all are equal. At most 2^31 - 2.
  uint32_t max_error = 0;
  /// The greatest sample that any page will have, if the type of the samples could hold more.
  uint32_t max_sample = 0xffffffff;
  /// All values that samples of any page have, ascending, at most 262144 of them; or empty. The model has a
  /// palette of them where that is smaller, and the bound is 0.
  std::vector<uint32_t> values;
  /// Whether pages have parents.
  bool parents = false;
  /// Whether values are names, which have nothing between them: then they are coded as such where that is
  /// smaller, and the bound is 0.
  bool labels = false;
  /// Of fitting with a bound, 1 or more: each takes as long; fewer make larger pages.
  int rounds = 6;
};

/// Fits a model to sample pages, or to all of them. Its result depends on these and their order alone: all
/// sums are integers, or of a fixed order.
class ModelBuilder {
 public:
  /// Keeps a copy of a page: `extent.voxels()` samples, and of its parents and its mask, if any.
  void add(std::span<const uint8_t> samples, Extent extent, const Parent<uint8_t>& parent = {},
           const Mask* mask = nullptr);
  void add(std::span<const uint16_t> samples, Extent extent, const Parent<uint16_t>& parent = {},
           const Mask* mask = nullptr);
  void add(std::span<const uint32_t> samples, Extent extent, const Parent<uint32_t>& parent = {},
           const Mask* mask = nullptr);
  /// On the threads of `ctx`. Errors: ErrorCode::usage where options contradict each other or the samples;
  /// ErrorCode::interrupted.
  Result<Model> build(const ModelOptions& options, const Context& ctx = {}) const;

  struct Page {
    Extent extent;
    std::vector<uint32_t> samples;
    std::vector<uint32_t> parents;  ///< the whole page of parents; empty: none
    Parent<uint32_t> parent;        ///< where it lies in these; its samples are not set
    std::optional<Mask> mask;       ///< none: all voxels are solid
  };

 private:
  /// Of labels.
  Model named(bool parents, uint32_t max_sample) const;
  template <class T>
  void keep(std::span<const T> samples, Extent extent, const Parent<T>& parent, const Mask* mask);
  std::vector<Page> pages_;
  uint32_t type_max_ = 0;  ///< of the widest type of samples
};

/// Appends the bytes of a page to `out`: none where all samples are within the bound of the background. They
/// depend on nothing but the model, the samples and, where the model has parents, `parent`. `decoded`, if it
/// is not empty, receives what the decoder will have. With a mask, only solid voxels are coded; others come
/// back as they are predicted, so that what is predicted from them goes on smoothly. Errors: ErrorCode::usage
/// for samples that the model cannot hold, or that are not `extent.voxels()` many, for parents that are not
/// those of all voxels, and for a mask with a model of samples of more than 16 bits.
Status encode_page(const Model& model, std::span<const uint8_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint8_t>& parent = {},
                   std::span<uint8_t> decoded = {}, const Mask* mask = nullptr);
Status encode_page(const Model& model, std::span<const uint16_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint16_t>& parent = {},
                   std::span<uint16_t> decoded = {}, const Mask* mask = nullptr);
Status encode_page(const Model& model, std::span<const uint32_t> samples, Extent extent,
                   std::vector<std::byte>& out, const Parent<uint32_t>& parent = {},
                   std::span<uint32_t> decoded = {}, const Mask* mask = nullptr);

/// The one sample that a page is full of, which its length shows; nothing where it has to be decoded. Errors:
/// ErrorCode::input where there is no such sample.
Result<std::optional<uint32_t>> uniform_sample(const Model& model, std::span<const std::byte> page);

/// Decodes a page of exactly these bytes into `extent.voxels()` samples. Safe on any bytes: it touches
/// nothing else, and damage that shows is ErrorCode::input; what was written by then is undefined.
/// ErrorCode::usage where the type is too narrow for the model, `out` is not of that size, or `parent` or
/// `mask` are not as when it was encoded; other samples or voxels of these than then are as good as damage to
/// the page.
Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent, std::span<uint8_t> out,
                   const Parent<uint8_t>& parent = {}, const Mask* mask = nullptr);
Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent,
                   std::span<uint16_t> out, const Parent<uint16_t>& parent = {}, const Mask* mask = nullptr);
Status decode_page(const Model& model, std::span<const std::byte> page, Extent extent,
                   std::span<uint32_t> out, const Parent<uint32_t>& parent = {}, const Mask* mask = nullptr);

/// One of several pages to decode.
template <class T>
struct PageJob {
  std::span<const std::byte> page;
  Extent extent;
  std::span<T> out;
  Parent<T> parent{};
  const Mask* mask = nullptr;  ///< as when it was encoded
};
/// As decode_page for each, several side by side, which is faster. The first damaged one in order is named by
/// `failed`, if given; the others are decoded all the same.
Status decode_pages(const Model& model, std::span<const PageJob<uint8_t>> jobs, size_t* failed = nullptr);
Status decode_pages(const Model& model, std::span<const PageJob<uint16_t>> jobs, size_t* failed = nullptr);
Status decode_pages(const Model& model, std::span<const PageJob<uint32_t>> jobs, size_t* failed = nullptr);

}  // namespace voxkit::page
