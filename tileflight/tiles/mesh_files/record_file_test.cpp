#include "tileflight/tiles/mesh_files/record_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/noise.h"

namespace tileflight::mesh_files::record_file_test {
namespace {

struct Record {
  std::uint64_t number = 0;
  float half = 0.0F;
};

TEST(RecordFile, IsAListWhileItIsWrittenAndAfterwards) {
  const tests::TemporaryFolder folder;
  RecordFile<Record> file(folder / "records");
  base::HashRandom random(3);
  constexpr std::uint64_t kCount = 200'000;  // several times what is written together
  for (std::uint64_t i = 0; i < kCount; ++i) {
    file.push_back({i, static_cast<float>(i) / 2});
    if (i % 997 != 0) continue;
    const auto any = static_cast<std::uint64_t>(random.uniform() * static_cast<double>(i));
    ASSERT_EQ(file.at(any).number, any);
    ASSERT_EQ(file.at(i).number, i);
  }
  EXPECT_EQ(file.size(), kCount);
  std::uint64_t next = 0;
  file.for_each([&](const Record& record) { ASSERT_EQ(record.number, next++); });
  EXPECT_EQ(next, kCount);
  file.push_back({kCount, 0.0F});
  file.change(kCount / 2, [](Record& record) { record.number += 1000; });
  for (int i = 0; i < 3000; ++i) {
    const auto any = static_cast<std::uint64_t>(random.uniform() * static_cast<double>(kCount + 1));
    ASSERT_EQ(file.at(any).number, any < kCount / 2 ? any : any + 1000);
  }
}

TEST(RecordFile, NamesTheFileThatCannotBeWritten) {
  EXPECT_THAT([] { const ScratchFile file("/nonexistent/records"); },
              ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("/nonexistent/records: cannot be written")));
}

}  // namespace
}  // namespace tileflight::mesh_files::record_file_test
