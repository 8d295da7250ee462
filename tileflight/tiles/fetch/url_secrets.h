#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tileflight::fetch {

/// Returns whether a query parameter of this name carries a key, token, session or signature.
bool is_secret_parameter(std::string_view parameter);

/// Returns a URL for messages. Values of secret parameters, long values of others (which may be tokens under another
/// name), user name and password are replaced by "…".
std::string redact_url(std::string_view url);

/// Returns the URL without its secret parameters, user name and fragment, which identifies the content independently of
/// the user. The other parameters keep their order.
std::string remove_secrets(std::string_view url);

/// Returns the value of a query parameter, written as in the URL (not decoded); empty if there is none.
std::string query_value(std::string_view url, std::string_view parameter);

/// Returns the URL with one more query parameter.
std::string add_query_parameter(const std::string& url, const std::string& parameter, const std::string& value);

/// Returns the URL with the query parameters of `from` that it lacks.
std::string inherit_query_parameters(const std::string& url, std::string_view from);

/// Returns the URL without query parameters that name a version or a snapshot of one stored object.
std::string remove_version_parameters(std::string_view url);

/// Returns the values of the secret parameters of a URL.
std::vector<std::string> find_secrets(std::string_view url);

/// Returns the text with all occurrences of the secrets hidden.
std::string mask_secrets(std::string text, const std::vector<std::string>& secrets);

}  // namespace tileflight::fetch
