#include "tileflight/core/base/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::base::files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::size_t entries_in(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(ReadText, IsWithoutAByteOrderMarkAndNeverUtf16) {
  using std::string_literals::operator""s;
  const tests::TemporaryFolder folder;
  write_file(folder / "f",
             "\xEF\xBB\xBF"
             "a,b");
  EXPECT_EQ(read_text(folder / "f"), "a,b");
  EXPECT_EQ(read_raw(folder / "f"),
            "\xEF\xBB\xBF"
            "a,b");
  for (const std::string& bytes : {"\xFF\xFE"
                                   "a\0"s,
                                   "\xFE\xFF\0a"s, "a\0,\0b\0"s, "\0a\0,\0b"s}) {
    write_file(folder / "f", bytes);
    EXPECT_THAT([&] { read_text(folder / "f"); },
                ThrowsMessage<InputError>(HasSubstr("f: is text in UTF-16; convert it: iconv")));
    EXPECT_EQ(read_raw(folder / "f"), bytes);
  }
}

TEST(WriteFile, IsReadBackAndLeavesNothingElse) {
  const tests::TemporaryFolder folder;
  const std::string bytes("a\0b\n", 4);
  write_file(folder / "f", "old");
  write_file(folder / "f", bytes);
  EXPECT_EQ(read_text(folder / "f"), bytes);
  EXPECT_EQ(read_bytes(folder / "f").size(), 4U);
  EXPECT_EQ(read_bytes(folder / "f")[2], std::byte{'b'});
  EXPECT_EQ(entries_in(folder.path()), 1U);
}

TEST(WriteFile, FullDeviceIsAnErrorAndTheDeviceStays) {
  EXPECT_THAT([] { write_file("/dev/full", "x"); },
              ThrowsMessage<InputError>(HasSubstr("/dev/full: cannot be written: No space left on device")));
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST(WriteFile, FailureKeepsTheOldFile) {
  const tests::TemporaryFolder folder;
  EXPECT_THAT([&] { write_file(folder / "no_such_folder/f", "x"); },
              ThrowsMessage<InputError>(HasSubstr("No such file or directory")));
  fs::create_directory(folder / "d");
  EXPECT_THAT([&] { write_file(folder / "d", "x"); }, ThrowsMessage<InputError>(HasSubstr("is a folder")));
}

TEST(WriteFile, FollowsASymbolicLinkInsteadOfReplacingIt) {
  const tests::TemporaryFolder folder;
  write_file(folder / "target", "old");
  fs::create_symlink("target", folder / "link");
  write_file(folder / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_text(folder / "target"), "new");
}

TEST(WriteFile, NewFilesHaveTheUsualPermissions) {
  const tests::TemporaryFolder folder;
  const mode_t mask = umask(022);
  write_file(folder / "f", "x");
  umask(mask);
  EXPECT_EQ(fs::status(folder / "f").permissions(), fs::perms(0644));
}

TEST(ReadText, ReadsWhatHasNoSize) {
  EXPECT_EQ(read_text("/dev/null"), "");
  EXPECT_THAT(read_text("/proc/self/status"), HasSubstr("Name:"));
}

TEST(ReadText, RefusesMissingFoldersAndTooLarge) {
  const tests::TemporaryFolder folder;
  write_file(folder / "f", "12345");
  EXPECT_EQ(read_text(folder / "f", 5), "12345");
  EXPECT_THAT([&] { read_text(folder / "f", 4); },
              ThrowsMessage<InputError>(HasSubstr("larger than the limit of 4 bytes")));
  EXPECT_THAT([&] { read_text("/dev/zero", 10000); }, ThrowsMessage<InputError>(HasSubstr("larger than")));
  EXPECT_THAT([&] { read_text(folder / "absent"); }, ThrowsMessage<InputError>(HasSubstr("No such file")));
  EXPECT_THAT([&] { read_text(folder.path()); }, ThrowsMessage<InputError>(HasSubstr("is a folder")));
}

TEST(Sha256, ExamplesOfTheStandard) {
  // FIPS 180-4 examples (NIST), and the empty message.
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, EqualsTheSystemsProgramAtEveryLengthAroundABlock) {
  const tests::TemporaryFolder folder;
  for (const std::size_t length : {1U, 55U, 56U, 57U, 63U, 64U, 65U, 119U, 120U, 128U}) {
    write_file(folder / "f", std::string(length, 'q'));
    FILE* pipe = popen(("sha256sum < " + (folder / "f").string()).c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    char text[65] = {};
    EXPECT_EQ(fread(text, 1, 64, pipe), 64U);
    pclose(pipe);
    EXPECT_EQ(sha256_hex_of_file(folder / "f"), text) << length;
  }
}

TEST(Sha256, InPartsAsInOne) {
  std::string bytes;
  for (int i = 0; i < 1000; ++i) bytes += static_cast<char>(i * 37 % 256);
  for (const std::size_t part : {1U, 7U, 63U, 64U, 65U, 200U, 1000U}) {
    Sha256 hash;
    for (std::size_t at = 0; at < bytes.size(); at += part) hash.add(std::string_view(bytes).substr(at, part));
    EXPECT_EQ(hash.hex(), sha256_hex(bytes)) << part;
    EXPECT_EQ(hash.hex(), sha256_hex(bytes)) << "asking changes nothing";
  }
}

TEST(Sha256, OfAFileLargerThanABlockThatIsRead) {
  const tests::TemporaryFolder folder;
  const std::string bytes((std::size_t{5} << 20) + 3, 'q');
  write_file(folder / "f", bytes);
  EXPECT_EQ(sha256_hex_of_file(folder / "f"), sha256_hex(bytes));
  EXPECT_THAT([&] { sha256_hex_of_file(folder.path()); },
              ThrowsMessage<InputError>(HasSubstr("is a folder, expected a file")));
  EXPECT_THAT([&] { sha256_hex_of_file(folder / "absent"); },
              ThrowsMessage<InputError>(HasSubstr("absent: cannot be opened")));
}

}  // namespace
}  // namespace tileflight::base::files_test

namespace tileflight::base::temporary_path_test {
namespace {

namespace fs = std::filesystem;

/// The id of a process that has ended.
pid_t ended_process() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

std::string name_for(pid_t process, const std::string& target = "out") {
  return "." + target + "." + std::to_string(process) + "-0.tmp";
}

TEST(TemporaryPath, IsNewAndBesideTheTarget) {
  tests::TemporaryFolder folder;
  const fs::path first = make_temporary_path(folder / "out");
  EXPECT_EQ(first.parent_path(), folder.path());
  std::ofstream(first) << "x";
  const fs::path second = make_temporary_path(folder / "out");
  EXPECT_NE(first, second);
  EXPECT_TRUE(fs::exists(first));
}

TEST(TemporaryPath, WhatAKilledRunLeftIsRemovedAndNothingElse) {
  tests::TemporaryFolder folder;
  const pid_t ended = ended_process();
  fs::create_directories(folder / name_for(ended) / "images");
  std::ofstream(folder / name_for(ended) / "images/000000.jpg") << "half";
  const std::string others[] = {name_for(::getppid()),
                                name_for(ended, "other"),
                                ".out.12x-0.tmp",
                                ".out.-0.tmp",
                                ".out." + std::to_string(ended) + "-.tmp",
                                ".out." + std::to_string(ended) + "-0.tmp.keep",
                                "out"};
  for (const std::string& other : others) std::ofstream(folder / other) << "mine";
  make_temporary_path(folder / "out");
  EXPECT_FALSE(fs::exists(folder / name_for(ended)));
  for (const std::string& other : others) EXPECT_TRUE(fs::exists(folder / other)) << other;
}

TEST(TemporaryPath, AKilledWriterOfAFolderIsClearedByTheNext) {
  tests::TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    write_folder(folder / "out", false, [](const fs::path& temporary) {
      std::ofstream(temporary / "half") << "half";
      ::_exit(9);
    });
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::is_empty(folder.path()));
  write_folder(folder / "out", false, [](const fs::path& temporary) { std::ofstream(temporary / "whole") << "whole"; });
  EXPECT_TRUE(fs::exists(folder / "out/whole"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace tileflight::base::temporary_path_test
