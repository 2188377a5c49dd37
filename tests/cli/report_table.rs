//! Tables of the terminal.

use skylit::report::{Row, Table, format_number, thousands};

#[test]
fn columns_line_up() {
    let row = |a: &str, b: &str| Row::new([a.into(), b.into()]);
    let table = Table::new(&["name", "n"]).row(row("a", "1000")).row(row("longer", "-"));
    assert_eq!(table.lines(), ["name       n", "a       1000", "longer     -"]);
}

#[test]
fn numbers_have_four_digits() {
    let of = |v: f64| format_number(v);
    assert_eq!([0.0, 1.0, 0.012344, -12.3456].map(of), ["0", "1.000", "0.01234", "-12.35"]);
    assert_eq!([123456.4, 1.2344e-7, 3e12, f64::INFINITY].map(of), ["123456", "1.234e-7", "3.000e12", "inf"]);
    assert_eq!([of(f64::NAN), of(0.099_999_99), of(-9999.96)], ["NaN", "0.1000", "-10000"]);
}

#[test]
fn thousands_are_apart() {
    assert_eq!([0, 999, 1000, 25_000_000].map(thousands), ["0", "999", "1,000", "25,000,000"]);
}
