#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/flight/telemetry.h"
#include "tileflight/geometry/files.h"

namespace tileflight::flight {

/// A test of one format of logs: what its reader makes of a file's text.
class LogTest : public testing::Test {
 protected:
  using Reader = Telemetry (*)(const std::filesystem::path&);

  LogTest(std::string name, Reader reader) : name_(std::move(name)), reader_(reader) {}

  Telemetry read(const std::string& text) const {
    geometry::write_file(folder_ / name_, text);
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

}  // namespace tileflight::flight
