#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Fixture for a log format: writes text to a file and reads it back with the format's reader.
class LogTest : public testing::Test {
 protected:
  using Reader = Telemetry (*)(const std::filesystem::path&);

  LogTest(std::string name, Reader reader) : name_(std::move(name)), reader_(reader) {}

  Telemetry read(const std::string& text) const {
    std::filesystem::remove(folder_ / name_);  // to replace a file that is there, ext4 waits for the disk
    base::write_file(folder_ / name_, text);
    return reader_(folder_ / name_);
  }
  std::string fault(const std::string& text) const {
    return tests::refusal_of([&] { read(text); });
  }

  tests::TemporaryFolder folder_;

 private:
  std::string name_;
  Reader reader_;
};

}  // namespace tileflight::flight_logs
