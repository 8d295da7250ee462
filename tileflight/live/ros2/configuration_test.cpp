#include "tileflight/live/ros2/configuration.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::ros2::configuration_test {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Ros2Configuration, IsLoopbackUnlessToldOtherwise) {
  EXPECT_THAT(configuration("", ""), HasSubstr("<NetworkInterface address=\"127.0.0.1\"/>"));
  const std::string of_user = configuration("", "file:///etc/dds.xml");
  EXPECT_THAT(of_user, HasSubstr(",file:///etc/dds.xml,"));
  EXPECT_THAT(of_user, Not(HasSubstr("127.0.0.1")));
  const std::string of_option = configuration("eth0", "file:///etc/dds.xml");
  EXPECT_THAT(of_option, HasSubstr("<NetworkInterface name=\"eth0\"/>"));
  EXPECT_THAT(of_option, Not(HasSubstr("dds.xml")));
  EXPECT_THAT(configuration("192.168.1.7", ""), HasSubstr("address=\"192.168.1.7\""));
}

TEST(Ros2Configuration, LimitsAndNoSharedMemoryAlways) {
  for (const std::string& one : {configuration("", ""), configuration("eth0", ""), configuration("", "<x/>")}) {
    EXPECT_THAT(one, HasSubstr("<WhcHigh>1 GB</WhcHigh>"));
    EXPECT_THAT(one, HasSubstr("<SharedMemory><Enable>false"));
  }
}

TEST(Ros2Configuration, ANameIsNoXml) {
  EXPECT_THAT(tests::refusal_of([] { configuration("lo\"/><Tracing>", ""); }), HasSubstr("is no name or address"));
  EXPECT_THAT(tests::refusal_of([] { configuration(std::string(100, 'x'), ""); }), HasSubstr("is no name or address"));
}

}  // namespace
}  // namespace tileflight::ros2::configuration_test
