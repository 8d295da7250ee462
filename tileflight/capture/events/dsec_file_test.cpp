#include "tileflight/capture/events/dsec_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::events::dsec_file_test {
namespace {

using testing::HasSubstr;

/// The times of DSEC's own example of ms_to_idx (scripts/utils/eventslicer.py of its repository).
std::vector<Event> example() {
  std::vector<Event> events;
  for (const std::uint32_t t_us : {0U, 500U, 2100U, 5000U, 5000U, 7100U, 7200U, 7200U, 8100U, 9000U})
    events.push_back({t_us, static_cast<std::uint16_t>(t_us % 640), static_cast<std::uint16_t>(t_us % 480),
                      static_cast<std::uint8_t>(t_us % 3 == 0)});
  return events;
}

std::vector<Event> many(std::size_t count) {
  std::vector<Event> events;
  for (std::uint32_t i = 0; i < count; ++i)
    events.push_back({i * 7, static_cast<std::uint16_t>(i * 31 % 640), static_cast<std::uint16_t>(i * 17 % 480),
                      static_cast<std::uint8_t>(i % 2)});
  return events;
}

TEST(DsecFile, IndexIsThatOfItsOwnExample) {
  const tests::TemporaryFolder folder;
  DsecWriter writer(folder.path() / "events.h5");
  writer.add(example());
  writer.finish(123456789012, 9500);
  const EventRecording read = read_dsec_file(folder.path() / "events.h5");
  EXPECT_EQ(read.events, example());
  EXPECT_EQ(read.t_offset_us, 123456789012);
  // Ours goes on to the end of the recording.
  EXPECT_EQ(read.ms_to_idx, (std::vector<std::uint64_t>{0, 2, 2, 3, 3, 3, 5, 5, 8, 9, 10}));
}

TEST(DsecFile, BytesDoNotDependOnHowEventsCome) {
  const tests::TemporaryFolder folder;
  const std::vector<Event> events = many(200000);
  DsecWriter at_once(folder.path() / "a.h5"), in_parts(folder.path() / "b.h5");
  at_once.add(events);
  for (std::size_t k = 0; k < events.size(); k += 333)
    in_parts.add(std::span(events).subspan(k, std::min<std::size_t>(333, events.size() - k)));
  at_once.finish(0, 1400000);
  in_parts.finish(0, 1400000);
  EXPECT_EQ(base::read_text(folder.path() / "a.h5"), base::read_text(folder.path() / "b.h5"));
  EXPECT_EQ(read_dsec_file(folder.path() / "b.h5").events, events);
}

TEST(DsecFile, MayHoldNoEvent) {
  const tests::TemporaryFolder folder;
  DsecWriter(folder.path() / "events.h5").finish(-5, 2001);
  const EventRecording read = read_dsec_file(folder.path() / "events.h5");
  EXPECT_TRUE(read.events.empty());
  EXPECT_EQ(read.t_offset_us, -5);
  EXPECT_EQ(read.ms_to_idx, (std::vector<std::uint64_t>{0, 0, 0, 0}));
}

TEST(DsecFile, BadFilesAreNamed) {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "events.h5";
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5"));
  base::write_file(file, "no HDF5");
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5: HDF5 failed: "));
  DsecWriter writer(folder.path() / "whole.h5");
  writer.add(many(70000));
  writer.finish(0, 490000);
  const std::string bytes = base::read_text(folder.path() / "whole.h5");
  for (std::size_t size = 0; size < bytes.size(); size += bytes.size() / 23) {
    base::write_file(file, bytes.substr(0, size));
    EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5"));
  }
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(folder.path() / "whole.h5", 100); }), HasSubstr("more than 100"));
  EXPECT_THAT(tests::refusal_of([&] { DsecWriter(folder.path() / "none" / "events.h5"); }), HasSubstr("HDF5 failed"));
}

}  // namespace
}  // namespace tileflight::events::dsec_file_test
