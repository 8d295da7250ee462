#include "tileflight/data/dataset/number_table.h"

#include <gmock/gmock.h>

#include <fstream>
#include <limits>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::dataset::number_table_test {
namespace {

using testing::HasSubstr;

TEST(NumberTable, NumbersComeBackAsTheyWere) {
  const tests::TemporaryFolder folder;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const NumberTable written{{"t [s]", "range [m]"}, {{0.1, kInfinity}, {1.0 / 3, -kInfinity}, {1e9 + 0.001, 1e-20}}};
  write_number_table(folder / "range.csv", written);
  const NumberTable read = read_number_table(folder / "range.csv");
  EXPECT_EQ(read.columns, written.columns);
  EXPECT_EQ(read.rows, written.rows);
}

TEST(NumberTable, DamageIsNamedWithItsLine) {
  const tests::TemporaryFolder folder;
  const auto fault = [&](const char* text) {
    std::ofstream(folder / "t.csv") << text;
    return tests::refusal_of([&] { read_number_table(folder / "t.csv"); });
  };
  EXPECT_THAT(fault(""), HasSubstr("t.csv: is empty"));
  EXPECT_THAT(fault("a,b\n1,2\n1\n"), HasSubstr("line 3: has 1 numbers, but the header has 2"));
  EXPECT_THAT(fault("a,b\n1,x\n"), HasSubstr("line 2: \"x\" is not a number"));
}

}  // namespace
}  // namespace tileflight::dataset::number_table_test
