// Points that are written and read, for tests of their readers.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "formats/mesh/point_cloud.h"
#include "tests/formats/file_format_test.h"
#include "tests/formats/point_files.h"

namespace voxkit {

class PointReadingTest : public FileFormatTest {
 protected:
  /// Reads all points twice, and keeps the notes.
  std::vector<CloudPoint> read(const std::string& name, const std::string& content) {
    const auto points = open_points(put(name, content));
    EXPECT_TRUE(points) << points.error().what;
    std::vector<CloudPoint> all, again;
    if (!points || !*points) return all;
    for (auto* to : {&all, &again}) {
      const Status status = (*points)->read([&](std::span<const CloudPoint> run) -> Status {
        to->insert(to->end(), run.begin(), run.end());
        return {};
      });
      EXPECT_TRUE(status) << status.error().what;
    }
    EXPECT_EQ(all.size(), again.size());
    EXPECT_EQ(all.size() + missing_, (*points)->size());
    notes_ = (*points)->notes();
    return all;
  }
  /// The error of opening or reading.
  std::string error_of(const std::string& name, const std::string& content) {
    const auto points = open_points(put(name, content));
    if (!points) {
      EXPECT_EQ(points.error().code, ErrorCode::input);
      return points.error().what;
    }
    const Status status = (*points)->read([](std::span<const CloudPoint>) -> Status { return {}; });
    return status ? "accepted" : status.error().what;
  }
  void expect_error(const std::string& name, const std::string& content, const std::string& part) {
    const std::string error = error_of(name, content);
    EXPECT_NE(error.find(part), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  size_t missing_ = 0;  ///< points that do not count
};
using Rgb = std::array<uint8_t, 3>;

}  // namespace voxkit
