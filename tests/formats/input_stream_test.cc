#include "formats/input_stream.h"

#include <functional>

#include "tests/formats/file_format_test.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class InputStreamTest : public FileFormatTest {
 protected:
  std::string random_text(size_t size, unsigned letters = 256) {
    std::string text(size, '\0');
    for (char& c : text) c = static_cast<char>(random_() % letters);
    return text;
  }
  /// All bytes, read in pieces of random sizes up to `piece`.
  Result<std::string> drain(InputStream& stream, size_t piece) {
    std::string all;
    for (;;) {
      std::string part(1 + random_() % piece, '\0');
      VOX_TRY(const size_t count, stream.read(std::as_writable_bytes(std::span(part))));
      all += part.substr(0, count);
      EXPECT_EQ(stream.position(), all.size());
      if (count < part.size()) return all;
    }
  }
  std::unique_ptr<InputStream> open(const std::string& content) {
    auto stream = open_stream(put("file", content));
    EXPECT_TRUE(stream);
    return std::move(*stream);
  }
};

TEST_F(InputStreamTest, FilesGiveTheirBytesInPiecesOfAnySize) {
  for (size_t size : {0, 1, 1000, 1 << 18, 700001}) {
    const std::string text = random_text(size);
    for (size_t piece : {7, 5000, 400000}) {
      if (size > 100000 && piece == 7) continue;
      EXPECT_EQ(*drain(*open(text), piece), text) << size << " " << piece;
    }
  }
}

TEST_F(InputStreamTest, SkipGoesOnBehind) {
  const std::string text = random_text(900000);
  for (uint64_t skip : {0ull, 1ull, 299990ull, 500000ull, 899995ull}) {
    for (bool packed : {false, true}) {
      auto stream = packed ? gunzip(open(gzip_text(text))) : open(text);
      std::string head(5, 0);
      ASSERT_TRUE(stream->read_exactly(std::as_writable_bytes(std::span(head)), "head"));
      ASSERT_TRUE(stream->skip(skip));
      EXPECT_EQ(stream->position(), skip + 5);
      std::string rest(text.size() - 5 - skip, 0);
      ASSERT_TRUE(stream->read_exactly(std::as_writable_bytes(std::span(rest)), "rest"));
      EXPECT_TRUE(rest == text.substr(5 + skip));
    }
    auto stream = open(text);
    ASSERT_TRUE(stream->skip(skip));
    std::string after(3, 0);
    ASSERT_TRUE(stream->read_exactly(std::as_writable_bytes(std::span(after)), "after"));
    EXPECT_EQ(after, text.substr(skip, 3));
  }
  auto stream = open("abc");
  const Status past = stream->skip(4);
  ASSERT_FALSE(past);
  EXPECT_EQ(past.error().code, ErrorCode::input);
  EXPECT_FALSE(open("abc")->skip(UINT64_MAX));
  EXPECT_FALSE(gunzip(open(gzip_text("abc")))->skip(UINT64_MAX));
}

TEST_F(InputStreamTest, LinesEndInEitherWay) {
  auto stream = open("one\ntwo\r\n\nlast");
  for (const char* line : {"one", "two", "", "last"}) EXPECT_EQ(**stream->read_line(), line);
  EXPECT_FALSE(stream->read_line()->has_value());
  EXPECT_EQ(open(std::string(100, 'x'))->read_line(99).error().code, ErrorCode::input);
  EXPECT_EQ((*open(std::string(100, 'x'))->read_line(100))->size(), 100u);
}

TEST_F(InputStreamTest, PrependedBytesComeFirst) {
  for (size_t piece : {1, 4, 100}) EXPECT_EQ(*drain(*prepend("abc", open("defgh")), piece), "abcdefgh");
  auto stream = prepend("abc", open("defgh"));
  ASSERT_TRUE(stream->skip(4));
  EXPECT_EQ(**stream->read_line(), "efgh");
}

TEST_F(InputStreamTest, WhatIsNoFileIsAnInputError) {
  EXPECT_EQ(open_stream(path("missing")).error().what, "No such file or directory");
  EXPECT_EQ(open_stream(folder_).error().code, ErrorCode::input);
  std::byte buffer[4];
  const Status cut = open("abc")->read_exactly(buffer, "header");
  EXPECT_EQ(cut.error().what, "header: ends after 3 bytes: expected 4");
}

struct Coding {
  const char* name;
  std::function<std::string(const std::string&)> pack;
  std::unique_ptr<InputStream> (*unpack)(std::unique_ptr<InputStream>);
};
const Coding codings[] = {
    {"gzip", gzip_text, gunzip}, {"zlib", zlib_text, inflate}, {"bzip2", bzip2_text, bunzip2}};
bool has_members(const Coding& coding) {
  return std::string(coding.name) != "zlib";
}

TEST_F(InputStreamTest, MembersAreJoinedAndPaddingIsAllowed) {
  for (const Coding& c : codings) {
    SCOPED_TRACE(c.name);
    for (size_t size : {0, 1, 40000, 1200000}) {
      const std::string text = random_text(size, 9);
      for (size_t piece : {1000, 5000000}) {
        EXPECT_EQ(*drain(*c.unpack(open(c.pack(text))), piece), text);
        if (!has_members(c)) continue;
        const std::string two = c.pack(text) + c.pack("second") + std::string(512, '\0');
        EXPECT_EQ(*drain(*c.unpack(open(two)), piece), text + "second");
      }
    }
  }
}

TEST_F(InputStreamTest, CutAndCorruptDataAreOneClearError) {
  for (const Coding& c : codings) {
    SCOPED_TRACE(c.name);
    const std::string text = random_text(300, 20), packed = c.pack(text);
    for (size_t length = 0; length < packed.size(); ++length) {
      auto stream = c.unpack(open(packed.substr(0, length)));
      const auto got = drain(*stream, 64);
      ASSERT_FALSE(got) << length;
      EXPECT_EQ(got.error().what, std::string(c.name) + " data end at packed byte " + std::to_string(length) +
                                      ": expected more");
    }
    for (size_t at = 0; at < packed.size(); ++at) {
      std::string changed = packed;
      changed[at] = static_cast<char>(changed[at] ^ 0x10);
      auto stream = c.unpack(open(changed));
      const auto got = drain(*stream, 64);
      // A few bytes of the headers mean nothing (gzip's time and system).
      if (got) {
        EXPECT_EQ(*got, text) << at;
      } else {
        EXPECT_NE(got.error().what.find("packed byte"), std::string::npos) << got.error().what;
        EXPECT_FALSE(drain(*stream, 64)) << "an error must stay one";
      }
    }
    if (!has_members(c)) continue;
    const auto garbage = drain(*c.unpack(open(packed + "garbage")), 1000);
    ASSERT_FALSE(garbage);
    EXPECT_NE(garbage.error().what.find("corrupt"), std::string::npos) << garbage.error().what;
    EXPECT_FALSE(drain(*c.unpack(open(packed + std::string(3, '\0') + packed)), 1000));
  }
}

TEST_F(InputStreamTest, ZlibDataMayBeGzipDataAndEndWhereTheyEnd) {
  const std::string text = random_text(5000, 9);
  for (const size_t piece : {1, 1000, 100000}) {
    EXPECT_EQ(*drain(*inflate(open(gzip_text(text) + gzip_text("second"))), piece), text + "second");
    EXPECT_EQ(*drain(*inflate(open(zlib_text(text) + "behind")), piece), text);
    EXPECT_EQ(*drain(*inflate(open(zlib_text("") + "behind")), piece), "");
  }
}

TEST_F(InputStreamTest, TheChecksumBehindTheDataIsChecked) {
  std::string packed = gzip_text("0123456789");
  packed[packed.size() - 8] = static_cast<char>(packed[packed.size() - 8] ^ 1);
  auto stream = gunzip(open(packed));
  char data[10];
  const bool read = stream->read_exactly(std::as_writable_bytes(std::span(data)), "data").has_value();
  EXPECT_FALSE(read && stream->check_end());
}

}  // namespace
}  // namespace voxkit
