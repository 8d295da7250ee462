#pragma once

#include <string>
#include <vector>

namespace tileflight::tiles {

/// Scheme, host and port of an http or https URL, as libcurl reads it (what is checked is what is asked).
struct Origin {
  std::string scheme;  ///< "http" or "https"
  std::string host;    ///< lower case
  std::string port;    ///< the scheme's own where the URL names none

  bool operator==(const Origin&) const = default;
};

/// Throws InputError: no URL, another scheme, a user name in it.
Origin origin_of(const std::string& url);

/// Where a tileset from the network may send its reader: to its own origin (over https too where it came over http),
/// and to hosts that the user has allowed. Never from https to http, never to a file.
class OriginPolicy {
 public:
  /// `allowed_hosts`: "host", or "host:port" for that port alone. Throws InputError for a root that is no URL.
  OriginPolicy(const std::string& root_url, std::vector<std::string> allowed_hosts = {});

  /// Throws InputError that names the URL and what it may not.
  void check(const std::string& url) const;
  /// Whether a URL is of the tileset's own origin: it alone is given the user's headers and credentials.
  bool is_own(const std::string& url) const;

 private:
  Origin own_;
  std::vector<std::string> allowed_hosts_;
};

}  // namespace tileflight::tiles
