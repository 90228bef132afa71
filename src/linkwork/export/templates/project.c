PROTOTYPE
{
    if (!lw_finite(q, LW_Q)) {
        return LW_NOT_FINITE;
    }
    *gap = lw_settle(q WITH_P);
    return *gap <= LW_OPEN ? LW_OK : LW_NOT_CLOSED;
}
