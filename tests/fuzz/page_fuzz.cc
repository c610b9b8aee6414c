// Any bytes as a model and a page: an error, or the samples of the decoder by the book, alone and beside
// another page; and what was decoded without a bound can be encoded, and comes back.
//
// An input is the sides of the page, less 1 and modulo 16, a byte each, the length of the model, two bytes,
// the model, of models with parents these, four bytes each, as far as there are so many, and the page.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "formats/little_endian.h"
#include "libpage/page.h"
#include "tests/libpage/reference.h"

namespace {

using namespace voxkit;
using namespace voxkit::page;
using Bytes = std::vector<std::byte>;

[[noreturn]] void stop(const std::string& fault) {
  std::fprintf(stderr, "%s\n", fault.c_str());
  std::abort();
}

/// What is expected of an error about bytes.
void expect_input(const Error& error) {
  if (error.code != ErrorCode::input || error.what.empty())
    stop("an error that no bytes can cause: " + error.what);
}

/// Half as many as the page has voxels along each side, rounded up; none where the model takes none.
struct Parents {
  Extent extent;
  std::vector<uint32_t> samples;
};

template <class T>
Parent<T> parent_of(const Parents& parents, const std::vector<T>& samples) {
  return {samples, parents.extent, 0, 0, 0};
}

/// Into a buffer of exactly its size; nothing where the page is damaged.
template <class T>
std::vector<T> decoded(const Model& model, const Bytes& page, Extent extent, const Parents& parents) {
  std::vector<T> out(static_cast<size_t>(extent.voxels())), parent_samples;
  for (const uint32_t sample : parents.samples) parent_samples.push_back(static_cast<T>(sample));
  const Status status =
      decode_page(model, page, extent, std::span<T>(out), parent_of(parents, parent_samples));
  if (!status) {
    expect_input(status.error());
    return {};
  }
  return out;
}

/// The same as of 32 bits, where samples have fewer.
template <class T>
void expect_narrow(const Model& model, const Bytes& page, Extent extent, const Parents& parents,
                   const std::vector<uint32_t>& samples) {
  if (model.max_sample() > std::numeric_limits<T>::max()) return;
  const auto narrow = decoded<T>(model, page, extent, parents);
  if (!std::ranges::equal(narrow, samples)) stop("samples depend on the type that they are decoded to");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t head = 5;
  if (size < head) return 0;
  const Extent extent{1 + data[0] % 16, 1 + data[1] % 16, 1 + data[2] % 16};
  const size_t model_bytes = std::min<size_t>(data[3] | data[4] << 8, size - head);
  const auto rest = std::as_bytes(std::span(data + head, size - head));
  const Bytes model_copy(rest.begin(), rest.begin() + static_cast<ptrdiff_t>(model_bytes));
  const Result<Model> model = Model::parse(model_copy);
  if (!model) {
    expect_input(model.error());
    return 0;
  }
  const Bytes serialised = model->serialise();
  const Result<Model> again = Model::parse(serialised);
  if (!again || again->serialise() != serialised) stop("a model does not come back");

  auto left = rest.subspan(model_bytes);
  Parents parents;
  if (model->has_parents()) {
    parents.extent = {(extent.nx + 1) / 2, (extent.ny + 1) / 2, (extent.nz + 1) / 2};
    parents.samples.resize(static_cast<size_t>(parents.extent.voxels()));
    for (uint32_t& sample : parents.samples) {
      if (left.size() < 4) break;
      sample = static_cast<uint32_t>(load_le<uint32_t>(left.data()) % (uint64_t{model->max_sample()} + 1));
      left = left.subspan(4);
    }
  }
  const Bytes page(left.begin(), left.end());
  const Parent<uint32_t> parent = parent_of(parents, parents.samples);

  const auto samples = decoded<uint32_t>(*model, page, extent, parents);
  expect_narrow<uint16_t>(*model, page, extent, parents, samples);
  expect_narrow<uint8_t>(*model, page, extent, parents, samples);
  if (std::ranges::any_of(samples, [&](uint32_t s) { return s > model->max_sample(); }))
    stop("a sample above the greatest of the model");

  // With a neighbour of the same extent both are decoded side by side.
  std::vector<uint32_t> first(static_cast<size_t>(extent.voxels())), second(first);
  const PageJob<uint32_t> jobs[] = {{page, extent, first, parent}, {page, extent, second, parent}};
  size_t failed = 0;
  const Status both = decode_pages(*model, std::span<const PageJob<uint32_t>>(jobs), &failed);
  if (both.has_value() == samples.empty()) stop("a page that is damaged beside another only, or alone only");
  if (!both && failed != 0) stop("the first damaged page is not the first");
  if (both && (first != samples || second != samples)) stop("pages side by side differ from one alone");

  if (samples.empty()) return 0;
  if (!model->has_labels()) {  // of which there is no plain decoder
    voxkit::page::test::ReferenceDecoder plain(serialised);
    if (plain.decode(page, extent, {parents.samples, parents.extent}) != samples)
      stop("the plain decoder has other samples");
  }
  Bytes encoded;
  if (const Status status = encode_page(*model, std::span<const uint32_t>(samples), extent, encoded, parent);
      !status)
    stop("what was decoded cannot be encoded: " + status.error().what);
  const auto back = decoded<uint32_t>(*model, encoded, extent, parents);
  if (back.empty()) stop("what was encoded is not valid");
  for (size_t i = 0; i < samples.size(); ++i) {
    const uint32_t apart = std::max(samples[i], back[i]) - std::min(samples[i], back[i]);
    if (apart > model->max_error()) stop(fmt::format("voxel {} is {} away", i, apart));
  }
  return 0;
}
