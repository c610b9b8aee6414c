#include "formats/output_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>

namespace voxkit {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "voxkit-output-" + std::to_string(getpid());
    fs::remove_all(folder_);
    fs::create_directory(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  void put(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }
  static std::string get(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  int files() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) count += entry.exists();
    return count;
  }
  std::string folder_;
};

TEST_F(OutputFileTest, AppearsOnlyWhenCommitted) {
  auto file = OutputFile::create(path("a"), false);
  ASSERT_TRUE(file);
  ASSERT_TRUE((*file)->write("hello"));
  EXPECT_EQ((*file)->position(), 5u);
  EXPECT_FALSE(fs::exists(path("a")));
  EXPECT_TRUE(fs::exists((*file)->temporary()));
  ASSERT_TRUE((*file)->commit());
  EXPECT_EQ(get(path("a")), "hello");
  EXPECT_EQ(files(), 1);
  struct stat info;
  ASSERT_EQ(stat(path("a").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0400, 0400u);
}

TEST_F(OutputFileTest, DestructorRemovesTheTemporary) {
  { ASSERT_TRUE(OutputFile::create(path("a"), false)); }
  EXPECT_EQ(files(), 0);
}

TEST_F(OutputFileTest, ExistingFilesNeedForceAndStayUntilTheEnd) {
  put("a", "old");
  const auto refused = OutputFile::create(path("a"), false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::output);
  EXPECT_EQ(refused.error().what, "exists: use --force to overwrite");
  EXPECT_FALSE(check_output(path("a"), false));
  EXPECT_TRUE(check_output(path("a"), true));
  fs::permissions(path("a"), fs::perms(0640));
  {
    auto file = OutputFile::create(path("a"), true);
    ASSERT_TRUE(file);
    ASSERT_TRUE((*file)->write("new"));
    EXPECT_EQ(get(path("a")), "old");
    ASSERT_TRUE((*file)->commit());
  }
  EXPECT_EQ(get(path("a")), "new");
  EXPECT_EQ(fs::status(path("a")).permissions(), fs::perms(0640));
}

TEST_F(OutputFileTest, DoesNotOverwriteWhatAppearedMeanwhile) {
  auto file = OutputFile::create(path("a"), false);
  ASSERT_TRUE(file);
  put("a", "other");
  EXPECT_FALSE((*file)->commit());
  file->reset();
  EXPECT_EQ(get(path("a")), "other");
  EXPECT_EQ(files(), 1);
}

TEST_F(OutputFileTest, KeepsSymbolicLinks) {
  put("target", "old");
  fs::create_symlink("target", path("link"));
  auto file = OutputFile::create(path("link"), true);
  ASSERT_TRUE(file);
  ASSERT_TRUE((*file)->write("new"));
  ASSERT_TRUE((*file)->commit());
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_EQ(get(path("target")), "new");
}

TEST_F(OutputFileTest, RefusesWhatCannotBeWritten) {
  for (const std::string& name : {folder_, path("none/a"), std::string()}) {
    const Status status = check_output(name, true);
    ASSERT_FALSE(status) << name;
    EXPECT_EQ(status.error().code, ErrorCode::output);
    EXPECT_FALSE(OutputFile::create(name, true));
  }
}

TEST_F(OutputFileTest, WritesThroughToDevices) {
  auto null = OutputFile::create("/dev/null", false);
  ASSERT_TRUE(null);
  EXPECT_TRUE((*null)->write("x"));
  EXPECT_TRUE((*null)->commit());
  auto full = OutputFile::create("/dev/full", false);
  ASSERT_TRUE(full);
  const Status status = (*full)->write("x");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::output);
}

TEST_F(OutputFileTest, AFullDiskLeavesNothing) {
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1000, 1000};
    setrlimit(RLIMIT_FSIZE, &limit);
    bool as_expected = false;
    {
      auto file = OutputFile::create(path("a"), false);
      const Status status = (*file)->write(std::string(5000, 'x'));
      as_expected = !status && status.error().code == ErrorCode::output;
    }
    _exit(as_expected ? 0 : 1);
  }
  int result = -1;
  waitpid(child, &result, 0);
  EXPECT_EQ(result, 0);
  EXPECT_EQ(files(), 0);
}

TEST_F(OutputFileTest, SignalHandlersRemoveTemporaries) {
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGTERM, [](int) {
      remove_temporaries();
      _exit(7);
    });
    std::vector<std::unique_ptr<OutputFile>> open;
    for (int i = 0; i < 100; ++i)
      open.push_back(std::move(*OutputFile::create(path(std::to_string(i)), false)));
    for (int i = 0; i < 100; i += 3) open[static_cast<size_t>(i)].reset();
    for (int i = 0; i < 100; i += 6)
      open[static_cast<size_t>(i)] = std::move(*OutputFile::create(path(std::to_string(i)), false));
    raise(SIGTERM);
    _exit(1);
  }
  int result = -1;
  waitpid(child, &result, 0);
  EXPECT_EQ(WEXITSTATUS(result), 7);
  EXPECT_EQ(files(), 0);
}

TEST_F(OutputFileTest, SeveralHaveTheirNamesTogetherOrNone) {
  const auto begin = [&](const std::vector<std::string>& names, bool force) {
    std::vector<std::unique_ptr<OutputFile>> files;
    for (const std::string& name : names) {
      auto file = OutputFile::create(path(name), force);
      EXPECT_TRUE(file);
      EXPECT_TRUE((*file)->write("new " + name));
      files.push_back(std::move(*file));
    }
    return files;
  };
  {
    const auto files = begin({"a", "b", "c"}, false);
    ASSERT_TRUE(commit_together(files));
  }
  EXPECT_EQ(get(path("a")) + get(path("b")) + get(path("c")), "new anew bnew c");
  EXPECT_EQ(files(), 3);

  // The second cannot have its name: somebody made a file of it.
  {
    const auto files = begin({"d", "e", "f"}, false);
    put("e", "theirs");
    const Status status = commit_together(files);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::output);
    EXPECT_FALSE(fs::exists(path("d")));
  }
  EXPECT_FALSE(fs::exists(path("d")) || fs::exists(path("f")));
  EXPECT_EQ(get(path("e")), "theirs");
  EXPECT_EQ(files(), 4);

  // With force old files are back: a folder has the name of the last.
  put("a", "old a");
  {
    const auto files = begin({"a", "g", "h"}, true);
    fs::create_directories(path("h/inside"));
    ASSERT_FALSE(commit_together(files));
  }
  EXPECT_EQ(get(path("a")), "old a");
  EXPECT_FALSE(fs::exists(path("g")));
  EXPECT_TRUE(fs::is_directory(path("h/inside")));
  {
    const auto files = begin({"a", "b"}, true);
    ASSERT_TRUE(commit_together(files));
  }
  EXPECT_EQ(get(path("a")), "new a");
  EXPECT_EQ(files(), 5);
}

}  // namespace
}  // namespace voxkit
