// An experiment from tiles to scores gives the same bytes whatever a processor has. Variants of libraries that can be
// forced on one machine stand for other processors.

#include <gtest/gtest.h>

#include <string>

#include "tests/same_files.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_experiments.h"

namespace tileflight::tests {
namespace {

struct Variant {
  const char* name;
  const char* environment;
};

class Processors : public testing::TestWithParam<Variant> {};

/// Files with times or the machine in them; what they state of the flight stands in the others.
bool holds_times(const std::string& file) {
  for (const char* name :
       {"report.html", "report.json", "results.json", "dataset.yaml", "odometry.json", "extract.json", ".file-hashes"})
    if (file.ends_with(name)) return true;
  return file.starts_with("stages/");
}

TEST_P(Processors, GiveTheSameBytes) {
  const std::filesystem::path usual = TinyExperiments::two_flights().made();
  const TemporaryFolder folder;
  TinyExperiments::write_two_flights(folder.path());
  const ProgramResult run =
      run_tileflight({"run", (folder / "experiment.yaml").string(), "--out", (folder / "out").string(), "--quiet"},
                     GetParam().environment);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  int compared = 0;
  for (const std::string& file : files_of(folder / "out")) {
    if (holds_times(file)) continue;
    EXPECT_TRUE(file_text(folder / "out" / file) == file_text(usual / "out" / file)) << file;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

INSTANTIATE_TEST_SUITE_P(
    All, Processors,
    testing::Values(
        // Both spellings of the C library's features: of releases before 2.33 and after.
        Variant{"CLibraryWithoutFusedOperations",
                "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"},
        Variant{"EmbreeWithSse2", "TILEFLIGHT_EMBREE=isa=sse2"}, Variant{"JpegWithoutVectors", "JSIMD_FORCENONE=1"},
        Variant{"BlasOfAnOldProcessor", "OPENBLAS_CORETYPE=Prescott OPENBLAS_NUM_THREADS=1"}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace tileflight::tests
