#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace throng::trajectory::detail {

/// Splits a line of CSV into trimmed fields; quoted ones lose their quotes (RFC 4180, but a field
/// ends with its line). `unquoted` keeps fields that had doubled quotes. False: a quote is open or
/// something follows a closing quote.
bool split_csv(std::string_view line, char delimiter, std::vector<std::string_view>& fields,
               std::vector<std::string>& unquoted);

/// What separates the columns of a line with names: ';', tab, ',' or, with none of them, ' '.
char csv_delimiter(std::string_view header);

}  // namespace throng::trajectory::detail
